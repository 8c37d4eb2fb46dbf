import { equals } from "@bufbuild/protobuf";
import { LinkModelSchema, type LinkModel } from "../api/gen/taclink/v1/arm_pb";

/** Whether a mesh of the one serves the other. */
export function sameShape(a: LinkModel, b: LinkModel): boolean {
  return a === b || equals(LinkModelSchema, a, b);
}
