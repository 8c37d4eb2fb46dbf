/** A call with one answer. */
export function answerOf(start, timeoutS) {
  return new Promise((resolve, reject) => {
    const options = { deadline: Date.now() + timeoutS * 1000 };
    start(options, (error, response) => (error ? reject(error) : resolve(response)));
  });
}

/** The messages of a call; leaving the loop cancels it. Throws after silenceS seconds without one; 0: never. */
export async function* messagesOf(start, silenceS) {
  const call = start();
  let timer;
  let silent = false;
  const listen = () => {
    if (silenceS <= 0) return;
    timer = setTimeout(() => {
      silent = true;
      call.cancel();
    }, silenceS * 1000);
  };
  call.on("error", () => {}); // of the cancelling below; all others reach the loop
  try {
    listen();
    for await (const message of call) {
      clearTimeout(timer);
      yield message;
      listen();
    }
  } catch (error) {
    throw silent ? new Error(`nothing from the server for ${silenceS} s; check server and network`) : error;
  } finally {
    clearTimeout(timer);
    call.cancel();
  }
}

/**
 * A call that takes the messages of an (async) iterable. When the server ends it early, the rest is not sent, which
 * shows once the iterable gives its next one.
 */
export async function answerTo(start, messages) {
  let over = false;
  let wake = () => {};
  let call;
  const answer = new Promise((resolve, reject) => {
    call = start((error, response) => {
      over = true;
      wake();
      if (error) reject(error);
      else resolve(response);
    });
  });
  answer.catch(() => {}); // told to the caller below
  call.on("drain", () => wake());
  try {
    for await (const message of messages) {
      if (over) break;
      if (!call.write(message)) await new Promise((resolve) => (wake = resolve));
    }
    call.end();
  } catch (error) {
    call.cancel();
    throw error;
  }
  return answer;
}
