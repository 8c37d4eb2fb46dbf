import { useSignal } from "@preact/signals";
import type { Link } from "../api/gen/taclink/v1/arm_pb";
import type { LinkTare } from "../api/gen/taclink/v1/tare_pb";
import { messageOf } from "../api/session";
import { useApp } from "../app_state";
import { Dialog } from "../ui/dialog";
import { fixed, newtons } from "../ui/format";
import { OperatorButton } from "../ui/operator_button";
import { totalMagnitudeN } from "../model/magnitude";

/** The steps of a procedure, numbered from 1, with the current one marked. */
export function Steps({ names, now }: { names: readonly string[]; now: number }) {
  return (
    <ol class="steps">
      {names.map((name, i) => (
        <li aria-current={i + 1 === now ? "step" : undefined} class={i + 1 < now ? "done" : ""}>
          {i + 1}. {name}
        </li>
      ))}
    </ol>
  );
}

/** Whether something touches the link now. */
export function TouchLine({ link }: { link: string }) {
  const store = useApp().store.value;
  store.beat.value;
  const frame = store.link(link).newest;
  if (!frame?.totalForceN)
    return (
      <p class="bad" role="status">
        {link}: not measured now. {frame?.statusReason}
      </p>
    );
  const contacts = frame.contacts.length;
  const force = `, ${newtons(totalMagnitudeN(frame))}`;
  return (
    <p class={contacts > 0 ? "numbers bad" : "numbers"} role="status">
      {link}:{" "}
      {contacts === 0
        ? "nothing touches it"
        : `${contacts === 1 ? "1 contact" : `${contacts} contacts`}${force}`}
    </p>
  );
}

/** Takes what links show now as their untouched skins, with a look before and the result after. */
export function TareDialog({ links, onClose }: { links: readonly Link[]; onClose: () => void }) {
  const app = useApp();
  const busy = useSignal(false);
  const trouble = useSignal("");
  const wasUndo = useSignal(false);
  const answers = useSignal<readonly LinkTare[]>([]);
  const tared = answers.value.filter((each) => each.accepted && !each.undone).map((each) => each.link);
  const refused = wasUndo.value ? [] : answers.value.filter((answer) => !answer.accepted);

  const tare = async (names: string[], how: { force?: boolean; undo?: boolean }) => {
    busy.value = true;
    wasUndo.value = how.undo ?? false;
    trouble.value = "";
    try {
      const answer = await app.session.tactile.tare({ links: names, ...how }, { timeoutMs: 20_000 });
      const kept = answers.value.filter((each) => !names.includes(each.link));
      answers.value = [...kept, ...answer.links];
    } catch (error) {
      trouble.value = messageOf(error);
    }
    busy.value = false;
  };
  const names = links.map((link) => link.name);
  const step = busy.value ? 2 : answers.value.length > 0 ? 3 : 1;

  return (
    <Dialog
      title={links.length === 1 ? `Tare ${names[0]}` : `Tare all ${links.length} links`}
      onClose={onClose}
    >
      <Steps names={["Free the skin", "Take frames", "Check the result"]} now={step} />
      {step === 1 && (
        <>
          <p>
            The mean of the next frames becomes the untouched skin. A link that is touched or moves is refused
            and keeps its baseline.
          </p>
          {names.map((name) => (
            <TouchLine link={name} />
          ))}
        </>
      )}
      <div aria-live="polite">
        {busy.value && <p>Taking frames …</p>}
        {trouble.value && (
          <p role="alert" class="refusal">
            {trouble.value}
          </p>
        )}
        {answers.value.map((answer) => (
          <p class={answer.accepted ? "numbers" : "refusal"}>
            {answer.accepted
              ? answer.undone
                ? `${answer.link}: the tare is undone.`
                : `${answer.link} is tared: the baseline moved by ${fixed(answer.shiftM * 1e3, 2)} mm.`
              : `${answer.link}: ${answer.reason}`}
          </p>
        ))}
      </div>
      <div class="dialog-foot">
        {refused.length > 0 && (
          <OperatorButton
            disabled={busy.value}
            class="danger"
            onClick={() =>
              void tare(
                refused.map((answer) => answer.link),
                { force: true },
              )
            }
          >
            Tare anyway
          </OperatorButton>
        )}
        {tared.length > 0 && (
          <OperatorButton disabled={busy.value} onClick={() => void tare(tared, { undo: true })}>
            Undo
          </OperatorButton>
        )}
        <OperatorButton disabled={busy.value} class="primary" onClick={() => void tare(names, {})}>
          {step === 3 ? "Again" : links.length === 1 ? "Tare" : "Tare all"}
        </OperatorButton>
        <button type="button" onClick={onClose}>
          Close
        </button>
      </div>
    </Dialog>
  );
}
