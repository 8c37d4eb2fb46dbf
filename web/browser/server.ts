import { spawn, spawnSync, type ChildProcess } from "node:child_process";
import { mkdtempSync, rmSync, writeFileSync } from "node:fs";
import { tmpdir } from "node:os";
import { join } from "node:path";
import { fileURLToPath } from "node:url";

const PROGRAMS = process.env.TACLINK_BIN ?? fileURLToPath(new URL("../../build/dev/bin", import.meta.url));
const START_MS = 60_000;
// What draws here is the processor: more would only make it late.
const RATE_HZ = 10;

/** The taclink command. Throws where it fails. */
export function taclink(...args: string[]): { stdout: string; stderr: string } {
  const done = spawnSync(join(PROGRAMS, "taclink"), args, { encoding: "utf8" });
  if (done.status !== 0) throw new Error(`taclink ${args.join(" ")}: ${done.stderr}`);
  return done;
}

/** A real taclinkd with simulated links, in a folder of its own. */
export class Server {
  url = "";
  address = "";
  output = "";
  readonly folder = mkdtempSync(join(tmpdir(), "taclink-browser-"));
  private process: ChildProcess | undefined;

  /** Of a file in the server's folder. */
  write(name: string, text: string): string {
    const path = join(this.folder, name);
    writeFileSync(path, text, { mode: 0o640 });
    return path;
  }

  /** Begins to serve; again at the same addresses after `kill`. */
  async start(...args: string[]): Promise<void> {
    this.output = "";
    const http = this.url ? new URL(this.url).host : "127.0.0.1:0";
    const all = ["--http-listen", http, "--listen", this.address || "127.0.0.1:0", ...args];
    const process = spawn(join(PROGRAMS, "taclinkd"), all, {
      cwd: this.folder,
      env: { ...globalThis.process.env, XDG_STATE_HOME: join(this.folder, "state") },
    });
    this.process = process;
    await new Promise<void>((resolve, reject) => {
      const timer = setTimeout(() => reject(new Error(`taclinkd did not start:\n${this.output}`)), START_MS);
      const take = (data: Buffer) => {
        this.output += data.toString();
        const page = /web page at (\S+)/.exec(this.output);
        const grpc = /listening on (\S+)/.exec(this.output);
        if (!page || !grpc) return;
        this.url = page[1].replace(/\/?$/, "/");
        this.address = grpc[1];
        clearTimeout(timer);
        resolve();
      };
      process.stdout.on("data", take);
      process.stderr.on("data", take);
      process.on("exit", (code) => reject(new Error(`taclinkd ended with ${code}:\n${this.output}`)));
    });
  }

  kill(): Promise<void> {
    const process = this.process;
    this.process = undefined;
    if (!process || process.exitCode !== null) return Promise.resolve();
    return new Promise((resolve) => {
      process.removeAllListeners("exit");
      process.on("exit", () => resolve());
      process.kill("SIGKILL");
    });
  }

  /** Stops the process where it is, and lets it go on. A page notices after some seconds. */
  pause(): void {
    this.process?.kill("SIGSTOP");
  }
  resume(): void {
    this.process?.kill("SIGCONT");
  }

  async close(): Promise<void> {
    await this.kill();
    rmSync(this.folder, { recursive: true, force: true });
  }
}

/** A scene that lasts: once the rest shape was taken, also by a busy machine, it is blown up and
 * something presses on it for good. */
export function pressed(path: number, ring: number, forceN: number): string {
  return `taclink_scene: 1
name: held
model: cylinder
frame_rate_hz: ${RATE_HZ}
duration_s: 3600
pressure_keyframes:
  - {time_s: 4.5, kpa: 0}
  - {time_s: 5.5, kpa: 1.5}
  - {time_s: 3600, kpa: 1.5}
contacts:
  - {at: {path: ${path}, ring: ${ring}}, force_n: ${forceN}, begin_s: 6, end_s: 3599, ramp_s: 0.5}
`;
}

/** A scene without a touch. */
export function untouched(): string {
  return `taclink_scene: 1
name: still
model: cylinder
frame_rate_hz: ${RATE_HZ}
duration_s: 3600
`;
}

/** A scene for somebody to press: inflated to 0.5 kPa once the rest shape was taken, and never touched by itself. */
export function free(): string {
  return `taclink_scene: 1
name: free
model: cylinder
frame_rate_hz: ${RATE_HZ}
duration_s: 3600
pressure_keyframes: [{time_s: 4, kpa: 0}, {time_s: 6, kpa: 0.5}, {time_s: 3600, kpa: 0.5}]
`;
}

/** Links above each other, each with its scene: a shipped one or a file. */
export function configuration(arm: string, scenes: Record<string, string>, more = ""): string {
  const links = Object.entries(scenes).map(
    ([name, scene], i) =>
      `    - {name: ${name}, model: cylinder, source: simulated, scene: ${scene}, pose: {position_mm: [0, 0, ${240 * i}]}}`,
  );
  return `taclink_config: 1\nlimits: {max_frame_age_s: 3600}\n${more}arm:\n  name: ${arm}\n  links:\n${links.join("\n")}\n`;
}
