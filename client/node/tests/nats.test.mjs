import assert from "node:assert/strict";
import { writeFileSync } from "node:fs";
import { after, before, test } from "node:test";

import { published } from "../lib/nats.mjs";
import { connect } from "../lib/taclink.mjs";
import { NatsServer, Taken } from "./nats.mjs";
import { assertFails, makeCertificate, PATIENCE_MS, run, Server, TOUCH, until } from "./server.mjs";

const limit = { timeout: PATIENCE_MS };
const nats = new NatsServer();
const server = new Server();
const takers = [];
let taclink;
before(async () => {
  await nats.start();
  const publish = `publish: {url: "${urlOf(nats)}", site: lab, contacts_deadband_n: 0}\n`;
  await server.start({ publish });
  taclink = await connect({ server: server.address });
}, limit);
after(async () => {
  for (const taker of takers) taker.stop();
  taclink?.close();
  await server.stop();
  await nats.stop();
});

function urlOf({ port }, scheme = "nats") {
  return `${scheme}://127.0.0.1:${port}`;
}

/** Of two options the later one counts. */
function example(...options) {
  return run(process.execPath, ["nats_contacts.mjs", "--site", "lab", "--nats", urlOf(nats), ...options]);
}

function take(open) {
  takers.push(new Taken(open));
  return takers.at(-1);
}

/** The frames of a gRPC stream. */
function takeFrames() {
  const request = { delivery: "DELIVERY_EVERY", detail: "DETAIL_CONTACTS" };
  return take(() => taclink.tactile.streamFrames(request));
}

/** What is published, once there is a stream. */
async function takePublished(options = {}) {
  await until("the stream", async () => (await example("--all", "--count", "1")).status === 0);
  return take((signal) => published({ url: urlOf(nats), site: "lab", signal, ...options }));
}

// Reports that the link has no new picture repeat the sequence of the last one.
function withPicture(frames) {
  return frames.filter((frame) => frame.times.exposure_utc_ns !== "0");
}

function framesOf(replies) {
  return withPicture(replies.filter(({ message }) => message === "frame").map(({ frame }) => frame));
}

function contactsOf(entries) {
  return withPicture(entries.filter(({ kind }) => kind === "contacts").map(({ message }) => message));
}

function eventsOf(entries) {
  return entries.filter(({ kind }) => kind === "event").map(({ message }) => message);
}

function sequencesOf(messages) {
  return messages.map(({ sequence }) => Number(sequence));
}

function isTouched(frame) {
  return frame.contacts.some((contact) => contact.normal_force_n > 0.9 * TOUCH.force_n);
}

/** Makes an event. */
function setWarning(warning_n) {
  return taclink.tactile.setThresholds({ link: TOUCH.link, thresholds: { warning_n } });
}

function hasWarning(entries, warning_n) {
  return eventsOf(entries).some(({ operation }) => operation?.values.warning_n === warning_n);
}

/** All events of the server until now, as StreamEvents tells them. */
async function toldEvents() {
  const events = [];
  let newest;
  for await (const { message, event, status } of taclink.tactile.streamEvents({ after_sequence: "0" })) {
    if (message === "event") events.push(event);
    else newest ??= Number(status.newest_sequence);
    if (newest !== undefined && events.length >= newest) return events;
  }
}

// When it went to a client is not the same for all.
function withoutSending(event) {
  return { ...event, times: { ...event.times, sent_utc_ns: "0" } };
}

test("nats_contacts.mjs prints link, forces in N and places in m", limit, async () => {
  await until("the touch", async () => {
    const { status, stdout } = await example("--count", "3");
    if (status !== 0) return false; // no stream yet
    assert.equal(stdout.match(/^\S+Z {2}test\/sleeve: /gm).length, 3, stdout);
    const found = /^ {2}#\d+: (\S+) N, force \(.*\) N at \(.*\) m$/m.exec(stdout);
    return found && Math.abs(Number(found[1]) - TOUCH.force_n) < 0.1 * TOUCH.force_n;
  });
});

test("the contacts are those of a gRPC stream", limit, async () => {
  const told = takeFrames();
  await told.until("frames", (replies) => framesOf(replies).length > 0);
  const site = await takePublished();
  const touched = (entries) => contactsOf(entries).filter(isTouched).length >= 20;
  await site.until("contacts", touched);
  const contacts = contactsOf(site.items);
  const last = Number(contacts.at(-1).sequence);
  await told.until("their frames", (replies) => Number(framesOf(replies).at(-1).sequence) >= last);
  await Promise.all([site.stop(), told.stop()]);

  const frames = framesOf(told.items);
  const both = contacts.filter(({ sequence }) => Number(sequence) >= Number(frames[0].sequence));
  assert.ok(both.length >= 10, `${both.length}`);
  const from = Number(both[0].sequence);
  const same = frames.filter(({ sequence }) => Number(sequence) >= from && Number(sequence) <= last);
  assert.deepEqual(both, same);
});

test("events arrive as StreamEvents tells them", limit, async () => {
  const site = await takePublished({ all: true });
  await setWarning(0.5 * TOUCH.force_n);
  const isWarning = ({ force_level: level }) => level?.level === "FORCE_LEVEL_WARNING";
  const arrive = (entries) => hasWarning(entries, 0.5 * TOUCH.force_n) && eventsOf(entries).some(isWarning);
  await site.until("events", arrive);
  await site.stop();
  const told = (await toldEvents()).map(withoutSending);
  const arrived = eventsOf(site.items);
  assert.deepEqual(arrived, told.slice(0, arrived.length));
});

test("nothing is lost or doubled when the NATS server is killed", limit, async () => {
  const frames = takeFrames();
  const site = await takePublished({ all: true });
  let shown = "";
  let shower;
  const options = ["nats_contacts.mjs", "--site", "lab", "--nats", urlOf(nats)];
  const showing = run(process.execPath, options, {}, (output, child) => {
    shown = output;
    shower = child;
  });
  await until("the example", () => shown.includes("test/sleeve: ok"));

  await setWarning(1);
  await nats.kill();
  await setWarning(2);
  const away = framesOf(frames.items).length;
  await frames.until("frames while it is away", (replies) => framesOf(replies).length >= away + 10);
  await nats.start();
  await setWarning(3);

  const told = sequencesOf(await toldEvents());
  const wanted = framesOf(frames.items);
  const everything = (entries) => {
    const events = new Set(sequencesOf(eventsOf(entries)));
    const contacts = new Set(sequencesOf(contactsOf(entries)));
    return told.every((event) => events.has(event)) && sequencesOf(wanted).every((frame) => contacts.has(frame));
  };
  await site.until("all that the server told", everything);
  await until("the example", () => shown.split(", thresholds: ").length > 3);
  shower.kill("SIGTERM");
  assert.match((await showing).stderr, /^NATS is away; waits for it\nNATS is back\n/);
  await Promise.all([site.stop(), frames.stop()]);
  await assertStreamIs(site.items);
});

/** The stream begins with what was taken from it, and nothing is in it twice. */
async function assertStreamIs(taken) {
  const again = await takePublished({ all: true });
  const end = Math.max(...taken.map((entry) => entry.stream_sequence));
  await again.until("the same", (entries) => entries.some((entry) => entry.stream_sequence > end));
  await again.stop();
  for (const all of [taken, again.items]) {
    for (const sequences of [sequencesOf(contactsOf(all)), sequencesOf(eventsOf(all))]) {
      assert.equal(new Set(sequences).size, sequences.length, "something is there twice");
    }
  }
  const inOrder = (entries) => [...entries].sort((a, b) => a.stream_sequence - b.stream_sequence);
  assert.deepEqual(
    inOrder(again.items.filter((entry) => entry.stream_sequence <= end)),
    inOrder(taken),
  );
}

/** A server that publishes to NATS with TLS. */
function startGuarded(guarded, site, authority) {
  const files = `tls_ca: "${guarded.path(authority)}", token_file: "${guarded.path("token")}"`;
  return new Server().start({ publish: `publish: {url: "${urlOf(guarded, "tls")}", site: ${site}, ${files}}\n` });
}

test("with TLS and a token only who trusts NATS and is known to it", limit, async () => {
  const guarded = new NatsServer();
  makeCertificate(guarded.folder);
  makeCertificate(guarded.folder, "other-");
  writeFileSync(guarded.path("token"), "a-token-of-this-test\n", { mode: 0o600 });
  writeFileSync(guarded.path("wrong-token"), "another\n");
  const servers = [];
  try {
    const tls = 'tls { cert_file: "ca.pem", key_file: "key.pem" }';
    await guarded.start(`authorization { token: "a-token-of-this-test" }\n${tls}`);
    servers.push(await startGuarded(guarded, "lab", "ca.pem"), await startGuarded(guarded, "misled", "other-ca.pem"));
    await assertGuarded(guarded);
    await assertMisled(guarded, servers[1]);
  } finally {
    for (const one of servers) await one.stop();
    await guarded.stop();
  }
});

async function assertGuarded(guarded) {
  const at = ["--nats", urlOf(guarded, "tls")];
  const trust = ["--tls-ca", guarded.path("ca.pem")];
  const token = ["--token", guarded.path("token")];
  const { stdout } = await until("contacts", async () => {
    const ended = await example(...at, ...trust, ...token, "--all", "--count", "3");
    return ended.status === 0 && ended;
  });
  assert.match(stdout, /^\S+ {2}test\/sleeve: /m);
  await assertFails(example(...at, ...trust), /^error: no NATS server lets us in at tls:.*Authorization/);
  const wrong = ["--token", guarded.path("wrong-token")];
  await assertFails(example(...at, ...trust, ...wrong), /^error: no NATS server lets us in at tls:.*Authorization/);
  const other = ["--tls-ca", guarded.path("other-ca.pem")];
  await assertFails(example(...at, ...other, ...token), /^error: no NATS server lets us in at tls:.*certificate/);
}

/** That server knows the token but does not trust NATS. */
async function assertMisled(guarded, misled) {
  await until("its complaint", () => / publish: no NATS server at tls:/.test(misled.output));
  await until("its attempts", () => guarded.output.match(/TLS handshake error/g)?.length >= 2);
  const at = ["--nats", urlOf(guarded, "tls"), "--tls-ca", guarded.path("ca.pem"), "--token", guarded.path("token")];
  await assertFails(example(...at, "--site", "misled"), /^error: no stream TACLINK_misled at .*\(stream not found\)/);
}

test("failures are one line and status 1", limit, async () => {
  const closed = await new NatsServer().start();
  await closed.stop();
  await assertFails(example("--nats", urlOf(closed)), /^error: no NATS server lets us in at nats:.*ECONNREFUSED/);
  await assertFails(example("--nats", urlOf(nats, "tls")), /^error: no NATS server .*\(it has no TLS\)/);
  await assertFails(example("--site", "moon"), /^error: no stream TACLINK_moon at .*\(stream not found\)/);
  await assertFails(example("--site", "*"), /^error: site and stream are letters/);
  await assertFails(example("--nats", "nats://"), /^error: NATS is at nats:\/\/HOST:PORT or/);
  const token = server.path("arm.yaml");
  await assertFails(example("--nats", "nats://robot", "--token", token), /^error: the token would go to robot in the/);
  await assertFails(example("--token", server.path("no-such-file")), /^error: .*no-such-file cannot be read/);
});
