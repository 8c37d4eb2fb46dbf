import { parseArgs } from "node:util";

import { connect, describe } from "./taclink.mjs";

const SERVER_OPTIONS = {
  server: ["HOST:PORT", "address of the server", process.env.TACLINK_SERVER || "127.0.0.1:50051"],
  "tls-ca": ["FILE", "certificates that the server's must be signed by: TLS", process.env.TACLINK_TLS_CA],
  "tls-certificate": ["FILE", "this client's own certificate", process.env.TACLINK_TLS_CERTIFICATE],
  "tls-key": ["FILE", "the key of this client's certificate", process.env.TACLINK_TLS_KEY],
};

const SERVER_NOTE =
  "The server's token is in the environment variable TACLINK_TOKEN.\n" +
  "TACLINK_PATIENCE_S: seconds to wait for a slow server, where that is more than usual.";

function help(options, note) {
  const lines = Object.entries(options).map(([name, [kind, what, preset]]) => {
    const left = `--${name}${kind ? ` ${kind}` : ""}`;
    return `  ${left.padEnd(24)} ${what}${preset ? ` (${preset})` : ""}`;
  });
  return [...lines, note].join("\n");
}

function read(options) {
  const known = { help: { type: "boolean" } };
  for (const [name, [kind]] of Object.entries(options)) known[name] = { type: kind ? "string" : "boolean" };
  const { values } = parseArgs({ options: known });
  const presets = Object.entries(options).map(([name, entry]) => [name, entry[2]]);
  return { ...Object.fromEntries(presets), ...values };
}

/** A number given as text; throws where it is none or not within the limits. */
export function number(name, text, least, most) {
  const value = Number(text);
  if (text.trim() === "" || !(value >= least && value <= most)) {
    throw new Error(`--${name} must be a number from ${least} to ${most}, not '${text}'`);
  }
  return value;
}

/**
 * Runs main(values) and ends with status 1 and one line where something fails. Options are name: [what follows it or
 * "", what it is for, preset]; the note is the last line of --help.
 */
export async function command(options, note, main) {
  process.stdout.on("error", (error) => process.exit(error.code === "EPIPE" ? 0 : 1)); // `| head`
  try {
    const values = read(options);
    if (values.help) console.log(help(options, note));
    else await main(values);
  } catch (error) {
    console.error(`error: ${describe(error)}`);
    process.exitCode = 1;
  }
}

/** As command, with a connection to the server that the options name: main(connection, values). */
export function program(options, main) {
  return command({ ...options, ...SERVER_OPTIONS }, SERVER_NOTE, async (values) => {
    const connection = await connect({
      server: values.server,
      token: process.env.TACLINK_TOKEN,
      tlsCa: values["tls-ca"],
      tlsCertificate: values["tls-certificate"],
      tlsKey: values["tls-key"],
    });
    try {
      await main(connection, values);
    } finally {
      connection.close();
    }
  });
}
