#!/usr/bin/env bash
# Links a controller's functions with everything unreachable removed, and fails if a panic or an allocator is still needed:
# first the core's own, then the whole C interface.
set -euo pipefail
cd "$(dirname "$0")/../.."
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT

# check NAME LIBRARY FUNCTION...
check() {
  local name=$1 library=$2
  shift 2
  {
    printf 'extern void %s(void);\n' "$@"
    echo "void *volatile keep[] = {$(printf '(void *)%s,' "$@")};"
    echo "void _start(void) { for (int i = 0; i < $#; i++) ((void (*)(void))keep[i])(); for (;;) {} }"
  } > "$folder/main.c"
  local link=(cc -nostdlib -static -ffreestanding -Wl,--gc-sections)
  "${link[@]}" -Wl,--unresolved-symbols=ignore-all -o "$folder/controller" "$folder/main.c" "$library"
  "${link[@]}" -o "$folder/strict" "$folder/main.c" "$library" 2> "$folder/undefined" || true
  local undefined panics
  undefined=$(grep -o "undefined reference to \`[^']*'" "$folder/undefined" | sort -u | grep -v -E "\`(memcpy|memset|memmove|memcmp|bcmp)'" || true)
  panics=$(nm "$folder/controller" | grep -E "panic|rust_begin_unwind|__rust_alloc|__rg_alloc" || true)
  if [ -n "$undefined" ] || [ -n "$panics" ]; then
    echo "$name needs what a controller does not have:" >&2
    echo "$undefined$panics" >&2
    exit 1
  fi
  echo "$name: no allocator, no panic, no undefined symbol; $(size "$folder/controller" | awk 'NR==2 {print $1}') bytes of code"
}

cargo build -q --profile embed -p armgap-embed
check "core" target/embed/libarmgap_embed.a \
  armgap_start_f64 armgap_update_f64 armgap_start_f32 armgap_update_f32 armgap_advance_f64 \
  armgap_advance_chain_f64 armgap_chain_torques_f64

cargo rustc -q --profile embed -p armgap-capi --no-default-features --features freestanding --crate-type staticlib --target-dir target/freestanding
library=target/freestanding/embed/libarmgap.a
mapfile -t functions < <(grep -o -E '\barmgap_[a-z0-9_]+\(' rust/capi/include/armgap.h | tr -d '(' | sort -u)
check "C interface" "$library" "${functions[@]}"

cc -O1 -w -I rust/capi/include rust/embed/stack.c "$library" -lm -o "$folder/stack"
"$folder/stack"
