import { setTimeout as pause } from "node:timers/promises";

import nats from "nats";

const PULL_MS = 5000;
const PULL_MESSAGES = 256;
const PAUSE_MS = 500; // after a failure
const FORGOTTEN_MS = 60_000; // JetStream deletes a consumer that does not ask for so long
const STREAM_NOT_FOUND = 10059; // of JetStream's errors

class StreamLost extends Error {}

/** Throws one line where there is no such stream. */
export async function streamInfo(connection, stream) {
  try {
    const manager = await connection.jetstreamManager({ checkAPI: false });
    return await manager.streams.info(stream);
  } catch (error) {
    const cause = error.code === nats.ErrorCode.NoResponders ? "it has no JetStream" : error.message;
    const where = connection.getServer();
    const text = `no stream ${stream} at ${where} (${cause}); taclinkd makes it, see publish: in docs/fleet.md`;
    throw error.api_error?.err_code === STREAM_NOT_FOUND ? new StreamLost(text) : new Error(text);
  }
}

/**
 * An ordered consumer of a subject of a stream: every message once and in order. Whenever one is missing, or NATS has
 * forgotten the consumer, another is made that begins where it was.
 */
export class Follower {
  #connection;
  #info;
  #subject;
  #next;
  #batch;
  #ended = false;

  /** info: streamInfo's. first: sequence in the stream to begin with. */
  constructor(connection, info, subject, first) {
    this.#connection = connection;
    this.#info = info;
    this.#subject = subject;
    this.#next = first;
  }

  async *messages() {
    while (!this.#ended) {
      try {
        yield* this.#untilGap(await this.#consumer());
      } catch (error) {
        if (this.#ended) return;
        if (error instanceof StreamLost || this.#connection.isClosed()) throw error;
        await pause(PAUSE_MS); // NATS is away, or not ready yet
      }
    }
  }

  stop() {
    this.#ended = true;
    this.#batch?.stop();
  }

  async #consumer() {
    const { config, created } = this.#info;
    const { state, created: now } = await streamInfo(this.#connection, config.name);
    if (now !== created) throw new StreamLost(`stream ${config.name} was made again; start again`);
    const manager = await this.#connection.jetstreamManager({ checkAPI: false });
    const { name } = await manager.consumers.add(config.name, {
      filter_subject: this.#subject,
      deliver_policy: nats.DeliverPolicy.StartSequence,
      opt_start_seq: Math.min(this.#next, state.last_seq + 1), // a stream's end may be lost with its machine
      ack_policy: nats.AckPolicy.None,
      inactive_threshold: nats.nanos(FORGOTTEN_MS),
      mem_storage: true,
    });
    return this.#connection.jetstream().consumers.get(config.name, name);
  }

  async *#untilGap(consumer) {
    let delivered = 0;
    while (!this.#ended) {
      this.#batch = await consumer.fetch({ max_messages: PULL_MESSAGES, expires: PULL_MS });
      if (this.#ended) this.#batch.stop();
      for await (const message of this.#batch) {
        if (message.info.deliverySequence !== ++delivered) return;
        this.#next = message.seq + 1;
        yield message;
      }
    }
  }
}
