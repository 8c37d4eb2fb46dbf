import { useSignal } from "@preact/signals";
import { useApp } from "../app_state";
import { Dialog } from "../ui/dialog";

/** Asks for the user's token. */
export function SignIn({ reason, onClose }: { reason: string; onClose: () => void }) {
  const app = useApp();
  const trouble = useSignal("");
  const submit = async (form: HTMLFormElement) => {
    const data = new FormData(form);
    trouble.value = await app.session.signIn(String(data.get("token") ?? ""), data.get("remember") !== null);
    if (!trouble.value) onClose();
  };
  return (
    <Dialog title="Sign in" onClose={onClose}>
      <form
        onSubmit={(event) => {
          event.preventDefault();
          void submit(event.currentTarget);
        }}
      >
        <p>{reason}</p>
        <label class="block">
          Token <input name="token" type="password" autocomplete="current-password" required autofocus />
        </label>
        <label class="block">
          <input type="checkbox" name="remember" /> keep it in this browser
        </label>
        {trouble.value && (
          <p role="alert" class="refusal">
            {trouble.value}
          </p>
        )}
        <p class="small">
          Whoever runs the server gives out tokens: <code>taclink token NAME --role viewer</code> or{" "}
          <code>operator</code>.
        </p>
        <div class="dialog-foot">
          <button type="submit" class="primary">
            Sign in
          </button>
          <button type="button" onClick={onClose}>
            Cancel
          </button>
        </div>
      </form>
    </Dialog>
  );
}
