// Client of a TacLINK server. Fields are named as in proto/taclink/v1, in SI units (m, N, Pa, s, rad). 64-bit
// numbers (times in ns, counts) are texts, which keeps them exact: BigInt(text) to compute with. Enums are their names.
import { fileURLToPath } from "node:url";

import grpc from "@grpc/grpc-js";
import protoLoader from "@grpc/proto-loader";

import { answerOf, answerTo, messagesOf } from "./calls.mjs";
import { callMetadata, channelCredentials } from "./credentials.mjs";
import { patienceS } from "./patience.mjs";

/** Folder of the .proto files. */
export const PROTO = fileURLToPath(new URL("../../../proto", import.meta.url));
const FILES = ["tactile", "recording", "operations", "pressure", "simulation"].map((name) => `taclink/v1/${name}.proto`);
const definition = protoLoader.loadSync(FILES, {
  includeDirs: [PROTO],
  keepCase: true,
  longs: String,
  enums: String,
  defaults: true,
  oneofs: true,
});
const { v1 } = grpc.loadPackageDefinition(definition).taclink;

const CONNECT_S = 3;
const CALL_S = 10;
const PING_ANSWER_S = 5;

// A service's methods as functions: `await getArm()`, `for await (const m of streamContacts({...}))`,
// `await updateJointStates(messages)`.
function callsOf(Service, server, channel, metadata) {
  const client = new Service(server, null, { channelOverride: channel });
  const calls = {};
  for (const [name, { originalName, requestStream, responseStream }] of Object.entries(Service.service)) {
    const call = client[name].bind(client);
    if (requestStream) {
      calls[originalName] = (messages) => answerTo((done) => call(metadata, done), messages);
    } else if (responseStream) {
      calls[originalName] = (request = {}, { silenceS = 0 } = {}) =>
        messagesOf(() => call(request, metadata), silenceS);
    } else {
      calls[originalName] = (request = {}, { timeoutS = patienceS(CALL_S) } = {}) =>
        answerOf((options, done) => call(request, metadata, options, done), timeoutS);
    }
  }
  return calls;
}

function noServer(server, error) {
  const cause = error.details
    .replace(/^.*Last error: (Error: )?/, "")
    .replace(/\.? ?Resolution note:.*$/s, "");
  return new Error(
    `no server answers at ${server} (${cause}); start taclinkd there or choose another with --server; ` +
      "a server with TLS needs --tls-ca, one with client_ca also --tls-certificate and --tls-key",
  );
}

/**
 * A connection with the services `tactile`, `recording`, `operations`, `pressure` and `simulation`, the `caller` that the server takes this
 * client for, and `close()`. A token goes with every call, never in the clear to another machine. Files are PEM. It
 * waits 3 s for the server, and calls wait 10 s, or what TACLINK_PATIENCE_S says where that is more.
 */
export async function connect({ server = "127.0.0.1:50051", ...secrets } = {}) {
  const metadata = callMetadata({ server, ...secrets });
  const channel = new grpc.Channel(server, channelCredentials(secrets), {
    "grpc.enable_http_proxy": 0, // robots are on the local network
    "grpc.keepalive_time_ms": 10_000, // a server that hangs, or whose network is gone, is noticed
    "grpc.keepalive_timeout_ms": Math.round(1000 * patienceS(PING_ANSWER_S)),
    "grpc.use_local_subchannel_pool": 1,
  });
  const connection = {
    tactile: callsOf(v1.TactileService, server, channel, metadata),
    recording: callsOf(v1.RecordingService, server, channel, metadata),
    operations: callsOf(v1.OperationsService, server, channel, metadata),
    pressure: callsOf(v1.PressureService, server, channel, metadata),
    simulation: callsOf(v1.SimulationService, server, channel, metadata),
    close: () => channel.close(),
  };
  try {
    connection.caller = await connection.operations.getCaller({}, { timeoutS: patienceS(CONNECT_S) });
  } catch (error) {
    channel.close();
    const unreachable = [grpc.status.UNAVAILABLE, grpc.status.DEADLINE_EXCEEDED].includes(error.code);
    throw unreachable ? noServer(server, error) : error;
  }
  return connection;
}

/** The message that the bytes hold; type: its name within taclink.v1. */
export function decode(type, bytes) {
  return definition[`taclink.v1.${type}`].deserialize(bytes);
}

/** One line for people: what the server said, or what is wrong here. */
export function describe(error) {
  const [line] = (error.details || error.message || String(error)).split("\n");
  return error.code in grpc.status ? `${line} (${grpc.status[error.code]})` : line;
}

/** ns since 1970-01-01 UTC, as text. */
export function utcText(ns) {
  return new Date(Number(BigInt(ns) / 1_000_000n)).toISOString();
}

/** s from one time in ns to another. */
export function secondsBetween(fromNs, toNs) {
  return Number(BigInt(toNs) - BigInt(fromNs)) / 1e9;
}
