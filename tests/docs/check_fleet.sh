# The manifests render, and the configuration in them is one that the server takes: check_fleet.sh SOURCE KUBECTL TACLINKD
set -euo pipefail
cd "$1/deploy/fleet"
umask 077
made=$(mktemp -d)
trap 'rm -rf "$made"' EXIT
"$2" kustomize site-example >"$made/all.yaml"
/usr/bin/python3 - "$made" <<'PY'
import json, sys, yaml
objects = list(yaml.safe_load_all(open(sys.argv[1] + "/all.yaml")))
kinds = {(o["kind"], o["metadata"]["name"].rsplit("-", 1)[0] if o["kind"] == "ConfigMap" else o["metadata"]["name"]): o for o in objects}
for wanted in [("DaemonSet", "taclinkd"), ("StatefulSet", "nats"), ("Deployment", "prometheus"), ("ConfigMap", "grafana-dashboard")]:
    assert wanted in kinds, f"{wanted} is missing; there are {sorted(kinds)}"
assert all(o["kind"] == "Namespace" or o["metadata"].get("namespace") == "taclink" for o in objects), "not in the namespace"
# What pods mount is there under the name that it was given.
maps = {o["metadata"]["name"] for o in objects if o["kind"] == "ConfigMap"}
for o in objects:
    for volume in o.get("spec", {}).get("template", {}).get("spec", {}).get("volumes", []):
        assert "configMap" not in volume or volume["configMap"]["name"] in maps, volume
        # Kubernetes' own default is 0644, which the server refuses.
        assert "secret" not in volume or volume["secret"].get("defaultMode") == 0o440, volume
        assert "secret" not in volume or "fsGroup" in o["spec"]["template"]["spec"].get("securityContext", {}), o["metadata"]["name"]
json.loads(kinds["ConfigMap", "grafana-dashboard"]["data"]["taclink.json"])
yaml.safe_load(kinds["ConfigMap", "prometheus-config"]["data"]["alerts.yml"])
open(sys.argv[1] + "/taclinkd.yaml", "w").write(kinds["ConfigMap", "taclinkd-config"]["data"]["taclinkd.yaml"])
PY
# Alerts and the dashboard ask for metrics that there are.
metrics=$(grep -rhoE '"taclink_[a-z_]+' ../../server/gateway | tr -d '"')
for name in $(grep -rhoE 'taclink_[a-z_]+' base/alerts.yml base/grafana-dashboard.json | sed -E 's/_(bucket|sum|count)$//' | sort -u); do
  grep -qx "$name" <<<"$metrics" || { echo "no metric is called $name" >&2; exit 1; }
done
# With secrets as docs/fleet.md makes them.
mkdir "$made/tls" "$made/tokens" "$made/nats"
openssl req -x509 -newkey ec -pkeyopt ec_paramgen_curve:P-256 -nodes -days 1 -subj /CN=site -keyout "$made/tls/tls.key" \
  -out "$made/tls/tls.crt" 2>/dev/null
"$(dirname "$3")/taclink" token new site --role viewer >"$made/tokens/tokens" 2>/dev/null
openssl rand -hex 24 >"$made/nats/token"
sed -i "s|/etc/taclink|$made|g" "$made/taclinkd.yaml"
"$3" --check-config --config "$made/taclinkd.yaml"
