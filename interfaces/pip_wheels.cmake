# Lets an ament package build against ROS 2 that came as Python wheels.
#
# Loaded through CMAKE_PROJECT_TOP_LEVEL_INCLUDES by the pip builds of lupin_msgs and of the packages here.
# colcon never loads it, and no CMakeLists.txt mentions it.

find_package(Python3 REQUIRED COMPONENTS Interpreter)

# Where ROS is: the prefix of the ament_package that this build's Python imports. sys.prefix would be wrong,
# as pip puts what a build needs into a temporary folder of its own.
execute_process(
  COMMAND "${Python3_EXECUTABLE}" -c
    "import ament_package, pathlib; print(pathlib.Path(ament_package.__file__).resolve().parents[4])"
  OUTPUT_VARIABLE _lupin_ros_prefix
  OUTPUT_STRIP_TRAILING_WHITESPACE
  COMMAND_ERROR_IS_FATAL ANY)
message(STATUS "ROS prefix: ${_lupin_ros_prefix}")
list(PREPEND CMAKE_PREFIX_PATH "${_lupin_ros_prefix}")
if(DEFINED ENV{AMENT_PREFIX_PATH})
  set(ENV{AMENT_PREFIX_PATH} "${_lupin_ros_prefix}:$ENV{AMENT_PREFIX_PATH}")
else()
  set(ENV{AMENT_PREFIX_PATH} "${_lupin_ros_prefix}")
endif()

# The wheels' imported targets name include folders of the container in which the wheels were made. CMake
# refuses targets with include folders that do not exist, so those are taken out before it generates.
function(lupin_forget_missing_includes)
  get_property(targets DIRECTORY "${CMAKE_SOURCE_DIR}" PROPERTY IMPORTED_TARGETS)
  foreach(target IN LISTS targets)
    get_target_property(folders "${target}" INTERFACE_INCLUDE_DIRECTORIES)
    if(NOT folders)
      continue()
    endif()
    set(present "")
    foreach(folder IN LISTS folders)
      if(folder MATCHES "^\\$<" OR IS_DIRECTORY "${folder}")
        list(APPEND present "${folder}")
      endif()
    endforeach()
    set_target_properties("${target}" PROPERTIES INTERFACE_INCLUDE_DIRECTORIES "${present}")
  endforeach()
endfunction()
# Deferred: the targets exist only after the package's CMakeLists.txt has run.
cmake_language(DEFER DIRECTORY "${CMAKE_SOURCE_DIR}" CALL lupin_forget_missing_includes)

# A run reads and writes small messages from Python, and waits for this build when it is the first one. So nothing
# is optimised, the sources of a C type support (whose names differ) are compiled as one, and where ROS 2 comes
# from wheels there is no C++: a whole first install takes 140 s of processor time instead of 298. NDEBUG stays: the
# generated conversions assert what Python's setters check already, and a failed assertion ends the process.
set(CMAKE_C_FLAGS_RELEASE "-O0 -DNDEBUG" CACHE STRING "")
set(CMAKE_CXX_FLAGS_RELEASE "-O0 -DNDEBUG" CACHE STRING "")
function(lupin_compile_as_one)
  foreach(kind rosidl_typesupport_c rosidl_typesupport_introspection_c rosidl_typesupport_fastrtps_c)
    set_target_properties("${PROJECT_NAME}__${kind}" PROPERTIES UNITY_BUILD ON UNITY_BUILD_BATCH_SIZE 0)
  endforeach()
endfunction()
cmake_language(DEFER DIRECTORY "${CMAKE_SOURCE_DIR}" CALL lupin_compile_as_one)

# A generator registers itself when its package is found; one for C++ is forgotten then.
macro(lupin_find_package method)
  find_package(${ARGN} BYPASS_PROVIDER)
  list(FILTER AMENT_EXTENSIONS_rosidl_generate_idl_interfaces EXCLUDE REGEX "_cpp:")
endmacro()
if("$ENV{ROS_DISTRO}" STREQUAL "")
  cmake_language(SET_DEPENDENCY_PROVIDER lupin_find_package SUPPORTED_METHODS FIND_PACKAGE)
endif()
