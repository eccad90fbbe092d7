# Sourced by tools/check and tools/test: the step that both have, running of steps, and reports of how long each took.
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

# Lints need only that shaders are there; with all features they are compiled for the lints alone.
lint() {
    PBR_VR_UNOPTIMIZED_SHADERS=1 cargo clippy --locked --workspace --all-targets --all-features -- -D warnings
}
