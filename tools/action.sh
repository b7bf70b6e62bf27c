#!/usr/bin/env bash
# What action.yml runs in a project: all parts, however the ones before ended. MISSIONS, SCENARIOS, PROVE and STRICT
# are its inputs.
set -uo pipefail
read -ra missions <<< "${MISSIONS:-}"
read -ra scenarios <<< "${SCENARIOS:-}"
check=(lupin check --github)
[ "${STRICT:-false}" = true ] && check+=(--strict)
[ -n "${PROVE:-}" ] && check+=(--prove "$PROVE")
worst=0
"${check[@]}" "${missions[@]}" || worst=$?
if [ ${#scenarios[@]} -gt 0 ]; then
  lupin test "${scenarios[@]}" || worst=$?
fi
exit "$worst"
