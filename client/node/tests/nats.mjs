import { spawn } from "node:child_process";
import { mkdtempSync, rmSync, writeFileSync } from "node:fs";
import { tmpdir } from "node:os";
import { join } from "node:path";

import { kill, until } from "./server.mjs";

const NATS_SERVER = process.env.NATS_SERVER ?? "nats-server";
const PATH = `${process.env.PATH}:/usr/sbin`; // where Debian has it

/** A real nats-server with JetStream, at a free port, which it keeps, and with a folder of its own. */
export class NatsServer {
  port = -1;
  output = "";
  folder = mkdtempSync(join(tmpdir(), "taclink-nats-"));

  path(name) {
    return join(this.folder, name);
  }

  /** more: of its configuration. */
  async start(more = "") {
    const listen = `listen: "127.0.0.1:${this.port}"\n`;
    writeFileSync(this.path("nats.conf"), `${listen}jetstream { store_dir: "store" }\n${more}\n`);
    // Again where another program has the port of one that was killed for a moment.
    await until("nats-server", () => this.#launch());
    this.port = Number(/client connections on 127\.0\.0\.1:(\d+)/.exec(this.output)[1]);
    return this;
  }

  async #launch() {
    this.output = "";
    let failure = "";
    this.process = spawn(NATS_SERVER, ["-c", "nats.conf"], { cwd: this.folder, env: { ...process.env, PATH } });
    const take = (data) => (this.output += data.toString());
    this.process.stdout.on("data", take);
    this.process.stderr.on("data", take);
    this.process.on("error", (error) => (failure = error.message));
    this.process.on("close", (code) => (failure ||= `it ended with ${code}`));
    await until("its port", () => failure || this.output.includes("Server is ready"));
    if (failure && !this.output.includes("address already in use")) {
      throw new Error(`${NATS_SERVER} did not start: ${failure}\n${this.output}`);
    }
    return !failure;
  }

  kill() {
    return kill(this.process);
  }

  async stop() {
    await this.kill();
    rmSync(this.folder, { recursive: true, force: true });
  }
}

/** Takes all that an iterable gives, until it is stopped. */
export class Taken {
  items = [];
  failure = null;
  #stopped = false;
  #abort;

  /** open(signal): the iterable. */
  constructor(open) {
    this.#abort = new AbortController();
    this.done = this.#take(open(this.#abort.signal));
  }

  async #take(iterable) {
    try {
      for await (const item of iterable) {
        if (this.#stopped) break;
        this.items.push(item);
      }
    } catch (error) {
      this.failure = error;
    }
  }

  /** Polls until check(items) gives something. */
  until(what, check) {
    return until(what, () => {
      if (this.failure) throw this.failure;
      return check(this.items);
    });
  }

  stop() {
    this.#stopped = true;
    this.#abort.abort();
    return this.done;
  }
}
