#!/usr/bin/env bash
# Links the controller's functions with everything unreachable removed, and fails if a panic or an allocator is still needed.
set -euo pipefail
cd "$(dirname "$0")/../.."
cargo build -q --profile embed -p armgap-embed
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cat > "$folder/main.c" <<'C'
extern void armgap_start_f64(void), armgap_update_f64(void), armgap_start_f32(void), armgap_update_f32(void), armgap_advance_f64(void);
void *volatile keep[] = {armgap_start_f64, armgap_update_f64, armgap_start_f32, armgap_update_f32, armgap_advance_f64};
void _start(void) { for (int i = 0; i < 5; i++) ((void (*)(void))keep[i])(); for (;;) {} }
C
cc -nostdlib -static -ffreestanding -Wl,--gc-sections -Wl,--unresolved-symbols=ignore-all \
  -o "$folder/controller" "$folder/main.c" target/embed/libarmgap_embed.a
cc -nostdlib -static -ffreestanding -Wl,--gc-sections -o "$folder/strict" "$folder/main.c" target/embed/libarmgap_embed.a 2> "$folder/undefined" || true
undefined=$(grep -o "undefined reference to \`[^']*'" "$folder/undefined" | sort -u | grep -v -E "\`(memcpy|memset|memmove|memcmp|bcmp)'" || true)
panics=$(nm "$folder/controller" | grep -c -E "panicking|armgap_panicked|__rust_alloc|__rg_alloc" || true)
if [ -n "$undefined" ] || [ "$panics" != 0 ]; then
  echo "the controller build needs what a controller does not have:" >&2
  echo "$undefined" >&2
  nm "$folder/controller" | grep -E "panicking|armgap_panicked|alloc" >&2 || true
  exit 1
fi
echo "controller build: no allocator, no panic, no undefined symbol; $(size "$folder/controller" | awk 'NR==2 {print $1}') bytes of code"
