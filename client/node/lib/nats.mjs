// What the servers of a site publish to NATS JetStream (docs/fleet.md).
import nats from "nats";

import { read, staysHere } from "./credentials.mjs";
import { Follower, streamInfo } from "./follower.mjs";
import { patienceS } from "./patience.mjs";
import { decode } from "./taclink.mjs";

const TYPES = { contacts: "LinkFrame", event: "Event" }; // by the last part of the subject
const URL_PATTERN = /^(?<scheme>nats|tls):\/\/(?<host>\[[\da-f:.]+\]|[^\s,@/:[\]]+)(?::(?<port>\d+))?$/;
const PART_PATTERN = /^[\w-]+$/; // of a subject
const CONNECT_S = 3;

function connectOptions({ url, token, tlsCa }) {
  const { scheme, host, port = "4222" } = URL_PATTERN.exec(url)?.groups ?? {};
  if (!scheme) throw new Error(`NATS is at nats://HOST:PORT or tls://HOST:PORT, not at '${url}'`);
  const tls = scheme === "tls" || Boolean(tlsCa);
  if (token && !tls && !staysHere(`${host}:${port}`)) {
    throw new Error(`the token would go to ${host} in the clear; use TLS (tls://, --tls-ca)`);
  }
  return {
    servers: `${host}:${port}`,
    token,
    // The host is what the certificate must name, also where it is an address.
    tls: tls ? { ca: tlsCa && read(tlsCa), host: host.replace(/[[\]]/g, "") } : undefined,
    ignoreClusterUpdates: !tls, // other machines', where the token would go in the clear
    timeout: 1000 * patienceS(CONNECT_S),
    maxReconnectAttempts: -1,
    reconnectTimeWait: 500,
    pingInterval: 5000,
  };
}

async function open(server) {
  const options = connectOptions(server);
  try {
    return await nats.connect(options);
  } catch (error) {
    const noTls = error?.code === nats.ErrorCode.ServerOptionNotAvailable;
    const cause = noTls ? "it has no TLS" : error?.chainedError?.message || error?.message || "it hung up";
    throw new Error(`no NATS server lets us in at ${server.url} (${cause}); check address, token and TLS`);
  }
}

// Never yields; ends when it is told to, and throws when there is nothing more to wait for.
async function* watch(connection, say, signal) {
  for await (const { type, data } of connection.status()) {
    if (type === nats.Events.Disconnect) say("NATS is away; waits for it");
    if (type === nats.Events.Reconnect) say("NATS is back");
    // All other errors end with a disconnection.
    if (type === nats.Events.Error && data === nats.ErrorCode.PermissionsViolation) {
      throw new Error("NATS does not permit this user to read the stream");
    }
  }
  if (!signal?.aborted) throw new Error("NATS does not let us in again; check the token");
}

// What each of them yields, as it comes; none runs ahead of the reader.
async function* merge(iterators) {
  const arrived = [];
  let wake = () => {};
  const arrive = (what) => {
    arrived.push(what);
    wake();
  };
  const ask = (iterator) =>
    iterator.next().then(
      (result) => arrive({ iterator, ...result }),
      (error) => arrive({ error }),
    );
  for (const iterator of iterators) ask(iterator);
  for (;;) {
    while (arrived.length === 0) await new Promise((resolve) => (wake = resolve));
    const { iterator, value, done, error } = arrived.shift();
    if (error) throw error;
    if (done) return;
    yield value;
    ask(iterator);
  }
}

function entry({ seq, subject, data }) {
  const [, , arm, link, kind] = subject.split(".");
  return { kind, arm, link, stream_sequence: seq, message: decode(TYPES[kind], data) };
}

/**
 * What a site publishes, as {kind, arm, link, stream_sequence, message}: of kind "contacts" a LinkFrame, of kind
 * "event" an Event; each kind in the stream's order, and once. Goes on by itself when NATS was away, which say(line) is
 * told. Leaving the loop ends it, as does an AbortSignal. all: begins with the oldest in the stream, else with what
 * comes from now on. Throws where there is no NATS or no such stream.
 */
export async function* published({ site, stream = `TACLINK_${site}`, all, say = () => {}, signal, ...server }) {
  for (const part of [site, stream]) {
    if (PART_PATTERN.test(part)) continue;
    throw new Error(`site and stream are letters, digits, '-' and '_', not '${part}'`);
  }
  const connection = await open(server);
  const followers = [];
  const end = async () => {
    for (const follower of followers) follower.stop();
    await connection.close();
  };
  signal?.addEventListener("abort", end, { once: true });
  try {
    if (signal?.aborted) return;
    const info = await streamInfo(connection, stream);
    const first = all ? 1 : info.state.last_seq + 1;
    for (const kind of Object.keys(TYPES)) {
      followers.push(new Follower(connection, info, `taclink.${site}.*.*.${kind}`, first));
    }
    const messages = followers.map((follower) => follower.messages());
    for await (const message of merge([watch(connection, say, signal), ...messages])) yield entry(message);
  } finally {
    await end();
  }
}
