# Sourced by tools/check and tools/test: runs their steps and reports how long each took.
# shellcheck shell=bash

STEPS=()

# Runs a command as a step with a name; its failure ends the script, as any other.
step() {
    local name=$1 start=$SECONDS
    shift
    echo "== $name"
    "$@"
    STEPS+=("$(printf '%5d s  %s' $((SECONDS - start)) "$name")")
}

print_steps() {
    printf '%s\n' "== times" "${STEPS[@]}" "$(printf '%5d s  in all' "$SECONDS")"
}
