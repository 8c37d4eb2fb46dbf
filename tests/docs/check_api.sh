# docs/api.md is what the .proto files say now: check_api.sh SOURCE PROTOC
set -euo pipefail
cd "$1"
made=$(mktemp -d)
trap 'rm -rf "$made"' EXIT
"$2" --include_source_info --include_imports --descriptor_set_out="$made/api.pb" -I proto proto/taclink/v1/*.proto
docs/tools/api_reference.py "$made/api.pb" >"$made/api.md"
diff docs/api.md "$made/api.md" || { echo "make docs/api.md anew; docs/tools/api_reference.py says how" >&2; exit 1; }
