# Sourced after setup.sh: several test commands one after the other, and one line at the end that adds up theirs.
# shellcheck shell=bash disable=SC2154

# run_levels COMMAND...: of tools/; each ends with "N passed, N failed". One that fails without saying what, or ends
# without that line, is a failure.
run_levels() {
  local level status output passed=0 failed=0 began=$SECONDS
  mkdir -p "$root/build"
  for level in "$@"; do
    say "== tools/$level"
    output=$root/build/level-$level.txt status=0
    "$root/tools/$level" | tee "$output" || status=$?
    if [[ $(tail -n 1 "$output") =~ ^([0-9]+)\ passed,\ ([0-9]+)\ failed$ ]]; then
      passed=$((passed + BASH_REMATCH[1]))
      failed=$((failed + BASH_REMATCH[2]))
      [ "$status" -eq 0 ] || [ "${BASH_REMATCH[2]}" -gt 0 ] || failed=$((failed + 1))
    else
      say "tools/$level ended with status $status and without a result"
      failed=$((failed + 1))
    fi
  done
  say "All levels took $((SECONDS - began)) s"
  printf '%s passed, %s failed\n' "$passed" "$failed"
  [ "$failed" -eq 0 ]
}
