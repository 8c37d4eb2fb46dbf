import type { Contact } from "../api/gen/taclink/v1/frame_pb";
import { useApp } from "../app_state";
import { lengthOf } from "../model/vectors";
import { fixed, newtons } from "../ui/format";

const MOST_ROWS = 6;

/** The contacts of a link as they are now, the hardest pressed first. */
export function ContactList({ link }: { link: string }) {
  const store = useApp().store.value;
  store.beat.value;
  const newest = store.link(link).newest;
  const contacts = [...(newest?.contacts ?? [])];
  const limit = newest?.detectionLimitN;
  const around = newest?.detectionLimitAroundN;
  const hidden =
    limit === undefined ? null : (
      <p class="empty">
        What presses less than {newtons(limit)} may not be found
        {around === undefined ? "" : `, nor less than ${newtons(around)} all around`}.
      </p>
    );
  if (contacts.length === 0) return hidden;
  contacts.sort((a, b) => b.normalForceN - a.normalForceN);
  const more = contacts.length - MOST_ROWS;
  return (
    <table class="contacts numbers" aria-label={`Contacts of ${link}`}>
      <thead>
        <tr>
          <th scope="col">Contact</th>
          <th
            scope="col"
            title="Integral of the inward load; of a ring contact, whose resultant is about zero, all that it presses with"
          >
            Pressed, N
          </th>
          <th scope="col" title="Of all loads of the contact, and its standard deviation">
            Resultant, N
          </th>
          <th scope="col" title="About the link frame's origin">
            Moment, N m
          </th>
          <th scope="col">Peak, kPa</th>
          <th scope="col">Area, cm²</th>
        </tr>
      </thead>
      <tbody>
        {contacts.slice(0, MOST_ROWS).map((contact) => (
          <tr key={String(contact.id)}>
            <th scope="row">#{String(contact.id)}</th>
            <td>{fixed(contact.normalForceN, 2)}</td>
            <td>{resultant(contact)}</td>
            <td>{fixed(contact.momentNm && lengthOf(contact.momentNm), 3)}</td>
            <td>{fixed(contact.peakPressurePa / 1e3, 2)}</td>
            <td>{fixed(contact.areaM2 * 1e4, 1)}</td>
          </tr>
        ))}
      </tbody>
      {more > 0 && <caption>and {more} more</caption>}
    </table>
  );
}

function resultant({ forceN, forceCovarianceN2: covariance }: Contact): string {
  if (!forceN) return fixed(undefined, 2);
  const force = fixed(lengthOf(forceN), 2);
  // The square root of the largest variance along an axis.
  const sigma =
    covariance.length === 6 ? Math.sqrt(Math.max(covariance[0], covariance[3], covariance[5])) : NaN;
  return Number.isFinite(sigma) ? `${force} ± ${fixed(sigma, 2)}` : force;
}
