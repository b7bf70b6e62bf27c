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
