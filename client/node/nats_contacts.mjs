// Prints the contacts and events that the servers of a site publish to NATS: forces in N, places in m, both in the
// link's frame.
import { read } from "./lib/credentials.mjs";
import { published } from "./lib/nats.mjs";
import { name, vector } from "./lib/print.mjs";
import { command, number } from "./lib/program.mjs";
import { utcText } from "./lib/taclink.mjs";

const OPTIONS = {
  nats: ["URL", "nats://HOST:PORT or tls://HOST:PORT", "nats://127.0.0.1:4222"],
  site: ["NAME", "as the servers have it in publish.site", "site"],
  stream: ["NAME", "as they have it in publish.stream; else TACLINK_ and the site", undefined],
  token: ["FILE", "holds the token that NATS wants", undefined],
  "tls-ca": ["FILE", "certificates that NATS' must be signed by: TLS", undefined],
  all: ["", "begin with the oldest that the stream has", false],
  count: ["N", "end after so many messages; 0: never", "0"],
};

function printContacts(where, frame) {
  const { contacts, times } = frame;
  const time = times.exposure_utc_ns === "0" ? "without a picture" : utcText(times.exposure_utc_ns);
  const status = name(frame.status, "LINK_STATUS_");
  const total = frame.total_force_n ? `total ${vector(frame.total_force_n, 3)} N` : "no forces are known";
  console.log(`${time}  ${where}: ${status}, ${contacts.length} contacts, ${total}`);
  for (const { id, normal_force_n: push, force_n: force, center_m: center } of contacts) {
    console.log(`  #${id}: ${push.toFixed(3)} N, force ${vector(force, 3)} N at ${vector(center, 4)} m`);
  }
}

function details(event) {
  const { contact, force_level: level, link_status: status, operation } = event;
  if (contact) {
    const { contact_id: id, normal_force_n: push, center_m: center } = contact;
    return `: #${id}, ${push.toFixed(3)} N at ${vector(center, 4)} m`;
  }
  if (level) return `: ${name(level.level, "FORCE_LEVEL_")}, ${level.force_n.toFixed(3)} N`;
  if (status) return `: ${name(status.status, "LINK_STATUS_")} ${status.reason}`.trimEnd();
  return operation ? `: ${operation.who}: ${operation.outcome}` : "";
}

function printEvent(where, event) {
  const kind = name(event.kind, "EVENT_KIND_");
  console.log(`${utcText(event.times.raised_utc_ns)}  ${where}: event ${event.sequence}, ${kind}${details(event)}`);
}

function tokenOf(file) {
  const token = read(file).toString().trim();
  if (!token) throw new Error(`${file} holds no token`);
  return token;
}

const NOTE = "Servers publish with the section publish of their configuration: docs/fleet.md.";

await command(OPTIONS, NOTE, async ({ nats: url, token, "tls-ca": tlsCa, ...options }) => {
  const count = number("count", options.count, 0, 1e9);
  const say = (line) => console.error(line);
  let taken = 0;
  const secrets = { token: token && tokenOf(token), tlsCa };
  for await (const { kind, arm, link, message } of published({ ...options, url, ...secrets, say })) {
    (kind === "event" ? printEvent : printContacts)(`${arm}/${link}`, message);
    if (++taken >= count && count > 0) break;
  }
});
