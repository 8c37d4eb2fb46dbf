# The reference of the API can be made of the .proto files and names every call: check_api.sh SOURCE PAGE
set -euo pipefail
for call in $(sed -n 's/^ *rpc \([A-Za-z]*\)(.*/\1/p' "$1"/proto/taclink/v1/*.proto); do
  grep -q "^| \`$call\` " "$2" || { echo "$2 lacks the call $call" >&2; exit 1; }
done
