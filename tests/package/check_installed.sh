# What packages install: programs and the library are hardened, the licenses of the dashboard's packages are there.
# check_installed.sh ROOT BUILD CMAKE READELF
set -euo pipefail
root=$1 build=$2 cmake=$3 readelf=$4
staged=$(mktemp -d)
trap 'rm -rf "$staged"' EXIT
for component in server library; do
  DESTDIR=$staged "$cmake" --install "$build" --component "$component" >/dev/null
done
wrong=0
complain() { echo "$*" >&2; wrong=1; }

checked=0
while IFS= read -r file; do
  name=${file##*/}
  checked=$((checked + 1))
  header=$("$readelf" -hlW "$file") dynamic=$("$readelf" -dW "$file") symbols=$("$readelf" --dyn-syms -W "$file")
  grep -qE '^ *Type: +DYN' <<<"$header" || complain "$name is not position-independent (-pie)"
  grep -q 'GNU_RELRO' <<<"$header" || complain "$name has no read-only relocations (-z relro)"
  grep -qE 'BIND_NOW|FLAGS_1.* NOW' <<<"$dynamic" || complain "$name binds lazily (-z now)"
  grep -q '__stack_chk_fail' <<<"$symbols" || complain "$name has no stack protector"
  [[ $file != */bin/* ]] || grep -qE ' __[a-z]+_chk@' <<<"$symbols" || complain "$name is built without _FORTIFY_SOURCE"
done < <(find "$staged" -type f \( -path '*/bin/*' -o -name 'lib*.so.*' \))
[ "$checked" -ge 3 ] || complain "only $checked programs and libraries are installed"

licenses=$(find "$staged" -name dashboard-licenses.txt)
if [ -z "$licenses" ]; then
  complain "the licenses of the dashboard's packages are not installed"
else
  node -p 'Object.keys(require(process.argv[1]).dependencies).join("\n")' "$root/web/package.json" | while read -r package; do
    grep -q "^$package [0-9]" "$licenses" || { echo "$licenses does not have $package" >&2; exit 1; }
  done || wrong=1
fi
exit "$wrong"
