import assert from "node:assert/strict";
import { execFileSync, spawn } from "node:child_process";
import { createHash } from "node:crypto";
import { mkdtempSync, rmSync, writeFileSync } from "node:fs";
import { tmpdir } from "node:os";
import { join } from "node:path";
import { fileURLToPath } from "node:url";

export const NODE_FOLDER = fileURLToPath(new URL("..", import.meta.url));
const TACLINKD =
  process.env.TACLINKD ?? fileURLToPath(new URL("../../../build/dev/bin/taclinkd", import.meta.url));
/** Long enough for a slow machine; what is waited for usually comes in a moment. */
export const PATIENCE_MS = 300_000;

/** The simulated touch once it has begun; base frame, of path 7 of 24 and ring 5, both from 1. */
export const TOUCH = { link: "sleeve", force_n: 0.2, angle_rad: Math.PI / 2, z_m: 0.19 };

const SCENE = `taclink_scene: 1
name: held
model: cylinder
frame_rate_hz: 10
duration_s: 36000
contacts:
  - {at: {path: 7, ring: 5}, force_n: 0.2, begin_s: 2, end_s: 35999, ramp_s: 0.5}
`;

export const STANDING_ARM = `arm:
  name: test
  links:
    - {name: sleeve, model: cylinder, source: simulated, scene: held.yaml, pose: {position_mm: [0, 0, 100]}}
`;

/** Polls until check() gives something, and gives that back. */
export async function until(what, check) {
  const end = Date.now() + PATIENCE_MS;
  for (;;) {
    const found = await check();
    if (found) return found;
    if (Date.now() > end) throw new Error(`in vain waited for ${what}`);
    await new Promise((resolve) => setTimeout(resolve, 50));
  }
}

/** A certificate that is its own authority, and its key; files' names: what it is for and ca.pem, key.pem. */
export function makeCertificate(folder, name = "") {
  const subject = ["-subj", "/CN=test", "-addext", "subjectAltName=IP:127.0.0.1"];
  const curve = ["-newkey", "ec", "-pkeyopt", "ec_paramgen_curve:prime256v1", "-nodes"];
  const files = ["-keyout", join(folder, `${name}key.pem`), "-out", join(folder, `${name}ca.pem`)];
  execFileSync("openssl", ["req", "-x509", ...curve, "-days", "2", ...files, ...subject], { stdio: "pipe" });
}

/** Kills a process, and waits until it is gone. */
export async function kill(process) {
  if (!process?.pid || process.exitCode !== null || process.signalCode !== null) return;
  const ended = new Promise((resolve) => process.once("exit", resolve));
  process.kill("SIGKILL");
  await ended;
}

/** A real taclinkd with a simulated arm, at a free port, with a folder of its own. */
export class Server {
  address = "";
  output = "";
  folder = mkdtempSync(join(tmpdir(), "taclink-node-"));

  /** Of a file in the server's folder. */
  path(name) {
    return join(this.folder, name);
  }

  async start({ arm = STANDING_ARM, security = "", publish = "" } = {}) {
    writeFileSync(this.path("held.yaml"), SCENE);
    writeFileSync(this.path("arm.yaml"), `taclink_config: 1\nlimits: {max_frame_age_s: 3600}\n${security}${publish}${arm}`);
    const options = ["--config", "arm.yaml", "--listen", "127.0.0.1:0", "--http-listen", "127.0.0.1:0"];
    const env = { ...process.env, XDG_STATE_HOME: this.path("state") };
    this.process = spawn(TACLINKD, options, { cwd: this.folder, env });
    const take = (data) => (this.output += data.toString());
    this.process.stdout.on("data", take);
    this.process.stderr.on("data", take);
    let failure = "";
    this.process.on("error", (error) => (failure = error.message));
    this.process.on("exit", (code) => (failure = `it ended with ${code}`));
    const addresses = await until("the server", () => {
      if (failure) throw new Error(`${TACLINKD} did not start: ${failure}\n${this.output}`);
      return /web page at (?<page>\S+)[^]*listening on (?<address>\S+)/.exec(this.output);
    });
    this.address = addresses.groups.address;
    this.page = addresses.groups.page;
    return this;
  }

  /** As start, with TLS and a token; more: of the configuration's security. */
  startSecured(token, role = "operator", more = "") {
    makeCertificate(this.folder);
    const hash = createHash("sha256").update(token).digest("hex");
    writeFileSync(this.path("tokens"), `tester ${role} ${hash}\n`, { mode: 0o600 });
    return this.start({ security: `security: {certificate: ca.pem, key: key.pem, tokens: tokens${more}}\n` });
  }

  async stop() {
    await kill(this.process);
    rmSync(this.folder, { recursive: true, force: true });
  }
}

// Without what the one who runs the tests has set for other servers; slow machines stay slow.
function plainEnvironment() {
  const others = /^TACLINK_(?!PATIENCE_S$)|^BUF_/;
  return Object.fromEntries(Object.entries(process.env).filter(([name]) => !others.test(name)));
}

/** Runs a program to its end; atOutput is called with all that it has written whenever it writes, and the process. */
export function run(command, options, env = {}, atOutput = () => {}) {
  return new Promise((resolve, reject) => {
    const child = spawn(command, options, { cwd: NODE_FOLDER, env: { ...plainEnvironment(), ...env } });
    let stdout = "";
    let stderr = "";
    child.stdout.on("data", (data) => {
      stdout += data;
      atOutput(stdout, child);
    });
    child.stderr.on("data", (data) => (stderr += data));
    child.on("error", reject);
    child.on("close", (status) => resolve({ status, stdout, stderr }));
  });
}

/** Of a run: status 1, and one line that says why. */
export async function assertFails(done, line) {
  const { status, stdout, stderr } = await done;
  assert.equal(status, 1);
  assert.equal(stdout, "");
  assert.match(stderr, line);
  assert.equal(stderr.trimEnd().split("\n").length, 1, stderr);
}
