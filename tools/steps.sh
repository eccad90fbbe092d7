# Sourced by tools/check and tools/test: runs their steps and reports how long each took.
# shellcheck shell=bash

STEPS=()
CURRENT_STEP=

# Runs a command as a step with a name; its failure ends the script, as any other.
step() {
    local start=$SECONDS
    CURRENT_STEP=$1
    shift
    echo "== $CURRENT_STEP"
    "$@"
    STEPS+=("$(printf '%5d s  %s' $((SECONDS - start)) "$CURRENT_STEP")")
    CURRENT_STEP=
}

# To be called when the script exits, be it after a failed step.
print_steps() {
    echo "== times"
    [ ${#STEPS[@]} -eq 0 ] || printf '%s\n' "${STEPS[@]}"
    printf '%5d s  in all\n' "$SECONDS"
    [ -z "$CURRENT_STEP" ] || echo "FAILED: $CURRENT_STEP"
}
