import type { ComponentChildren } from "preact";
import { useApp } from "../app_state";

/** Why the user can't change anything now; empty: they can. */
export function useRefusal(): string {
  const app = useApp();
  if (app.log.value) return "A log is played: go back to the live arm first.";
  if (app.store.value.lookedAtS.value !== undefined)
    return "The page shows a past moment: press Back to now first.";
  const caller = app.session.caller.value;
  if (!caller) return "Not connected.";
  if (app.session.mayOperate.value) return "";
  if (!caller.name) return "Sign in as an operator to do this.";
  return `${caller.name} may look but not change anything: sign in as an operator.`;
}

/** A button for what only operators may do; says why where it is disabled. */
export function OperatorButton(props: {
  onClick: () => void;
  children: ComponentChildren;
  class?: string;
  disabled?: boolean;
  anyRole?: boolean;
  type?: "button" | "submit";
}) {
  const refusal = useRefusal();
  const refused = props.anyRole ? "" : refusal;
  // aria-disabled and not disabled: the reason, its description, is to be found with the keyboard, too.
  return (
    <button
      type={props.type ?? "button"}
      class={props.class}
      aria-disabled={refused !== "" || props.disabled ? "true" : undefined}
      title={refused || undefined}
      onClick={(event) => {
        if (refused || props.disabled) return event.preventDefault();
        if (props.type !== "submit") props.onClick();
      }}
    >
      {props.children}
    </button>
  );
}
