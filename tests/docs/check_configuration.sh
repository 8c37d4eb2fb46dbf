# docs/configuration.md is what the program prints: check_configuration.sh ROOT TACLINKD
set -eu
"$2" --print-config-reference | diff -u "$1/docs/configuration.md" - ||
  { echo "renew it: taclinkd --print-config-reference > docs/configuration.md"; exit 1; }
