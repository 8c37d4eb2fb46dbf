// vite-node browser/print_messages.ts FRAME EVENT...: what the page makes of messages in files, one JSON object a line,
// and that its texts name every kind of event.
import { readFileSync } from "node:fs";
import { fromBinary, toJson } from "@bufbuild/protobuf";
import { EventKindSchema, EventSchema } from "../src/api/gen/taclink/v1/events_pb";
import { LinkFrameSchema } from "../src/api/gen/taclink/v1/frame_pb";
import { eventText, nameOf } from "../src/ui/words";

const JSON_OPTIONS = { useProtoFieldName: true, alwaysEmitImplicit: true };
const [frameFile = "", ...eventFiles] = process.argv.slice(2);
console.log(
  JSON.stringify(toJson(LinkFrameSchema, fromBinary(LinkFrameSchema, readFileSync(frameFile)), JSON_OPTIONS)),
);
for (const file of eventFiles) {
  const event = fromBinary(EventSchema, readFileSync(file));
  if (nameOf(EventKindSchema, event.kind) === "unknown" || /unknown|undefined/.test(eventText(event)))
    throw new Error(`the page does not know event kind ${event.kind}: ${eventText(event)}`);
  console.log(JSON.stringify(toJson(EventSchema, event, JSON_OPTIONS)));
}
