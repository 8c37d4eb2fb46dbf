import { Code, ConnectError } from "@connectrpc/connect";
import { afterEach, beforeEach, expect, test, vi } from "vitest";
import { keepOpen } from "../src/api/keep_open";

beforeEach(() => {
  vi.useFakeTimers();
});
afterEach(() => {
  vi.useRealTimers();
});

test("pauses grow while it fails, and begin anew after a message", async () => {
  const stop = new AbortController();
  const pauses: number[] = [];
  let lives = 0;
  const done = keepOpen(stop.signal, {
    run: async (_, alive) => {
      if (++lives === 4) alive();
      throw new ConnectError("gone", Code.Unavailable);
    },
    onLost: (reason, retryInMs, code) => {
      expect(reason).toBe("gone");
      expect(code).toBe(Code.Unavailable);
      pauses.push(retryInMs);
      if (lives === 6) stop.abort();
    },
    silenceMs: 0,
    firstRetryMs: 100,
    longestRetryMs: 300,
  });
  await vi.advanceTimersByTimeAsync(5000);
  await done;
  expect(pauses).toEqual([100, 200, 300, 100, 200, 300]);
});

test("silence ends a life", async () => {
  const stop = new AbortController();
  const reasons: string[] = [];
  const done = keepOpen(stop.signal, {
    run: (end, alive) => {
      alive();
      return new Promise((_, reject) => end.addEventListener("abort", () => reject(new Error("aborted"))));
    },
    onLost: (reason) => {
      reasons.push(reason);
      stop.abort();
    },
    silenceMs: 1000,
  });
  await vi.advanceTimersByTimeAsync(999);
  expect(reasons).toEqual([]);
  await vi.advanceTimersByTimeAsync(2);
  await done;
  expect(reasons).toEqual(["Nothing comes from the server."]);
});

test("once aborted nothing is told and nothing begins", async () => {
  const stop = new AbortController();
  let lives = 0;
  const done = keepOpen(stop.signal, {
    run: (end) => {
      ++lives;
      return new Promise((_, reject) => end.addEventListener("abort", () => reject(new Error("aborted"))));
    },
    onLost: () => expect.fail("nobody wants to know"),
    silenceMs: 0,
  });
  stop.abort();
  await vi.advanceTimersByTimeAsync(10_000);
  await done;
  expect(lives).toBe(1);
});
