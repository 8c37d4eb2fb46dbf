import type { Contact, LinkFrame } from "../api/gen/taclink/v1/frame_pb";
import { lengthOf } from "./vectors";

/** How strongly a contact acts on the skin, N; see taclink.v1.Contact. */
export function magnitudeN({ normalForceN, forceN }: Pick<Contact, "normalForceN" | "forceN">): number {
  return Math.max(normalForceN, forceN ? lengthOf(forceN) : 0);
}

/** Sum over the contacts, N; NaN: the forces are not known. */
export function totalMagnitudeN({ totalForceN, contacts }: LinkFrame): number {
  return totalForceN ? contacts.reduce((sum, contact) => sum + magnitudeN(contact), 0) : NaN;
}
