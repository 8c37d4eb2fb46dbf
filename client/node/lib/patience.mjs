const MOST_S = 86_400; // far below what timers can hold

/**
 * Seconds to wait where nothing else is asked for: usualS, or what the environment variable TACLINK_PATIENCE_S says
 * where that is more. Not set and empty are the same; more than a day counts as a day. Throws where it is no positive
 * number.
 */
export function patienceS(usualS) {
  const text = process.env.TACLINK_PATIENCE_S;
  if (!text) return usualS;
  const seconds = Number(text);
  if (!(Number.isFinite(seconds) && seconds > 0)) {
    throw new Error(
      `the environment variable TACLINK_PATIENCE_S is '${text}', but must be a positive number of seconds, such as 60`,
    );
  }
  return Math.max(usualS, Math.min(seconds, MOST_S));
}
