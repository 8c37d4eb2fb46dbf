// Records some seconds of what the arm feels on the server, lists the logs there, and plays the new one again.
import { patienceS } from "./lib/patience.mjs";
import { number, program } from "./lib/program.mjs";
import { secondsBetween, utcText } from "./lib/taclink.mjs";

const OPTIONS = {
  seconds: ["S", "how long to record", "5"],
  speed: ["X", "how fast to play, 0.1 to 100; 0: as fast as it can be read", "2"],
  name: ["NAME", "part of the log's name", "example"],
  delete: ["", "delete the log at the end", false],
};

// Ctrl-C ends it early, so that the recording is ended in any case.
async function pause(seconds) {
  const signals = ["SIGINT", "SIGTERM"];
  let timer;
  const over = new Promise((resolve) => {
    timer = setTimeout(resolve, seconds * 1000);
    for (const signal of signals) process.once(signal, resolve);
  });
  console.log(`records for ${seconds} s`);
  await over;
  clearTimeout(timer);
  for (const signal of signals) process.removeAllListeners(signal);
}

async function record(recording, name, seconds) {
  await recording.startRecording({ name, note: "record_replay.mjs" });
  await pause(seconds);
  const { status } = await recording.stopRecording({}, { timeoutS: patienceS(60) });
  if (status.trouble) throw new Error(status.trouble);
  console.log(
    `recorded ${status.log}: ${status.frames} frames, ${status.frames_lost} lost, ${status.bytes} bytes`,
  );
  return status.log;
}

async function list(recording) {
  const { logs } = await recording.listLogs();
  for (const log of logs) {
    const seconds = secondsBetween(log.start_utc_ns, log.end_utc_ns).toFixed(1);
    console.log(
      `  ${log.name}: ${utcText(log.start_utc_ns)}, ${seconds} s, ${log.frames} frames of ${log.links.join(", ")}`,
    );
  }
}

function strongest(frame) {
  return Math.max(0, ...frame.contacts.map((contact) => contact.normal_force_n));
}

// One line for each second of the log: frames and the largest force of each link.
class Seconds {
  second = 0;
  links = new Map();

  add(second, frame) {
    if (second > this.second) this.print(second);
    const link = this.links.get(frame.link) ?? { frames: 0, force: 0 };
    this.links.set(frame.link, { frames: link.frames + 1, force: Math.max(link.force, strongest(frame)) });
  }

  print(next) {
    const texts = [...this.links].map(
      ([name, link]) => `${name} ${link.frames} frames, at most ${link.force.toFixed(3)} N`,
    );
    if (texts.length > 0) console.log(`  ${this.second} s: ${texts.join("; ")}`);
    this.links.clear();
    this.second = next;
  }
}

async function replay(recording, log, speed) {
  const request = {
    log,
    speed,
    detail: "DETAIL_CONTACTS",
    without_events: true,
    without_contacts: true,
    without_arm: true,
  };
  const seconds = new Seconds();
  let frames = 0;
  let status;
  console.log(`plays ${log}`);
  for await (const reply of recording.replay(request, { silenceS: patienceS(10) })) {
    if (reply.message === "status") status = reply.status;
    if (reply.message !== "frame") continue;
    ++frames;
    seconds.add(Math.floor(secondsBetween(status.from_utc_ns, reply.log_utc_ns)), reply.frame);
  }
  seconds.print(0);
  const length = secondsBetween(status.from_utc_ns, status.to_utc_ns).toFixed(1);
  console.log(`played ${frames} frames in ${length} s of the log, ${status.damaged} places damaged`);
}

await program(OPTIONS, async ({ recording }, options) => {
  const length = number("seconds", options.seconds, 0.1, 3600);
  const speed = number("speed", options.speed, 0, 100);
  const log = await record(recording, options.name, length);
  await list(recording);
  await replay(recording, log, speed);
  if (options.delete) await recording.deleteLog({ log });
});
