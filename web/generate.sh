#!/bin/sh
# TypeScript of the API, from proto/taclink/v1.
set -eu
cd "$(dirname "$0")"
rm -rf src/api/gen
mkdir -p src/api/gen
protoc -I ../proto --plugin=node_modules/.bin/protoc-gen-es --es_out=src/api/gen --es_opt=target=ts \
  ../proto/taclink/v1/*.proto
