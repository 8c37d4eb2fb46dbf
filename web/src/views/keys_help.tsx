import { useSignal } from "@preact/signals";
import { useEffect } from "preact/hooks";
import { Dialog } from "../ui/dialog";

const KEYS: [string, string][] = [
  ["← → ↑ ↓", "turn the arm; on a map: choose a marker"],
  ["+ −", "zoom the arm"],
  ["Home", "the whole arm"],
  ["mouse on a simulated skin", "press it; drag: move; wheel: depth"],
  ["mouse beside it", "turn the arm; wheel: zoom"],
  ["← → on the time line", "a second back or on; page keys: ten; Home, End"],
  ["Tab", "from control to control"],
  ["Esc", "close a window; go back to now"],
  ["?", "this list"],
];

/** What keys do: `?` shows it. */
export function KeysHelp() {
  const open = useSignal(false);
  useEffect(() => {
    const press = (event: KeyboardEvent) => {
      const typing =
        event.target instanceof HTMLElement && /^(INPUT|SELECT|TEXTAREA)$/.test(event.target.tagName);
      if (event.key === "?" && !typing) open.value = true;
    };
    addEventListener("keydown", press);
    return () => removeEventListener("keydown", press);
  }, []);
  if (!open.value)
    return (
      <button type="button" aria-label="Keys" title="Keys (?)" onClick={() => (open.value = true)}>
        ?
      </button>
    );
  return (
    <Dialog title="Keys" onClose={() => (open.value = false)}>
      <dl class="facts">
        {KEYS.map(([keys, what]) => (
          <>
            <dt>{keys}</dt>
            <dd>{what}</dd>
          </>
        ))}
      </dl>
    </Dialog>
  );
}
