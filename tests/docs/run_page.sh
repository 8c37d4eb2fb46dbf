# Runs a page's blocks of `sh` in order, in a folder of their own, beside a server with the simulated arm where the page
# talks to one: run_page.sh PAGE BIN-FOLDER [ARGUMENTS OF THE SERVER...]
set -euo pipefail
page=$1 bin=$(realpath "$2")
shift 2
folder=$(mktemp -d)
server=
# A server that still runs would write into the folder while it is deleted. It gets a minute to end.
end_server() {
  [ -n "$server" ] && kill "$server" 2>/dev/null || return 0
  timeout 60 tail -f /dev/null --pid="$server" -s 0.05 || { echo "the server does not end: it is killed" >&2; kill -KILL "$server"; }
  wait "$server" || true
}
trap 'end_server; rm -rf "$folder"' EXIT
awk '/^```sh$/ {on = 1; next} /^```/ {on = 0} on' "$page" >"$folder/page.sh"
[ -s "$folder/page.sh" ] || { echo "$page has no blocks of sh" >&2; exit 1; }
ln -s "$(realpath "$(dirname "$0")/../../deploy")" "$folder/deploy"
cd "$folder"
export PATH=$bin:$PATH XDG_STATE_HOME=$folder/state

if grep -qE 'taclink (list|watch|poke|contacts|events|record|tare|set|thresholds|joints|pressure|restart)' page.sh; then
  : >server.log  # it is read before the server may have opened it
  taclinkd "$@" --listen 127.0.0.1:0 --http-listen 127.0.0.1:0 >server.log 2>&1 &
  server=$!
  for ((i = 0; i < 1200; i++)); do
    address=$(sed -n 's/.*listening on \(127.*\)/\1/p' server.log)
    if [ -n "$address" ]; then
      export TACLINK_SERVER=$address
      # All links measure.
      taclink list | awk 'NR > 1 && $2 != "ok" {waits = 1} END {exit waits}' && break
    fi
    kill -0 "$server" || { cat server.log; exit 1; }
    sleep 0.1
  done
  [ "$i" -lt 1200 ] || { echo "the server's links do not measure" >&2; cat server.log; exit 1; }
fi
bash -euo pipefail -x page.sh
