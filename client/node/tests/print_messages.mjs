// print_messages.mjs ADDRESS EVENTS: a frame and events as this client has them, one JSON object a line.
import { connect } from "../lib/taclink.mjs";

const [, , server, count] = process.argv;
const { tactile, close } = await connect({ server });
for await (const { frame } of tactile.streamFrames({ detail: "DETAIL_FULL" })) {
  if (!frame) continue;
  console.log(JSON.stringify(frame));
  break;
}
let left = Number(count);
for await (const { event } of tactile.streamEvents({})) {
  if (!event) continue;
  console.log(JSON.stringify(event));
  if (--left === 0) break;
}
close();
