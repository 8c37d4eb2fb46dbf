import assert from "node:assert/strict";
import { after, before, test } from "node:test";

import { connect } from "../lib/taclink.mjs";
import { PATIENCE_MS, Server } from "./server.mjs";

const TOKEN = "a-token-of-this-test";
const limit = { timeout: PATIENCE_MS };
const server = new Server();
before(() => server.startSecured(TOKEN), limit);
after(() => server.stop());

function secured(more = {}) {
  return { server: server.address, tlsCa: server.path("ca.pem"), token: TOKEN, ...more };
}

test("with TLS and a token the server knows the caller, also in streams", limit, async () => {
  const { caller, tactile, close } = await connect(secured());
  assert.deepEqual(caller, { name: "tester", role: "ROLE_OPERATOR", tokens: true });
  for await (const message of tactile.streamContacts()) {
    assert.equal(message.links.length, 1);
    break;
  }
  close();
});

test("without its token nobody gets in", limit, async () => {
  for (const token of ["", "another"]) {
    const { caller, tactile, close } = await connect(secured({ token }));
    assert.equal(caller.role, "ROLE_NOBODY");
    await assert.rejects(tactile.getArm(), { code: 16 });
    close();
  }
});

test("a server that does not show a trusted certificate is none", limit, async () => {
  await assert.rejects(connect({ server: server.address }), /no server answers at/);
  const other = new Server();
  try {
    await other.startSecured(TOKEN);
    await assert.rejects(
      connect(secured({ tlsCa: other.path("ca.pem") })),
      /no server answers at .*certificate/,
    );
  } finally {
    await other.stop();
  }
});

test("a client shows its own certificate to a server that asks for one", limit, async () => {
  const asking = new Server();
  try {
    await asking.startSecured(TOKEN, "viewer", ", client_ca: ca.pem");
    const known = { server: asking.address, tlsCa: asking.path("ca.pem"), token: TOKEN };
    await assert.rejects(connect(known), /no server answers at/);
    const own = { tlsCertificate: asking.path("ca.pem"), tlsKey: asking.path("key.pem") };
    const { caller, close } = await connect({ ...known, ...own });
    assert.equal(caller.role, "ROLE_VIEWER");
    close();
  } finally {
    await asking.stop();
  }
});

test("a token does not go to another machine in the clear", async () => {
  for (const address of [
    "robot:50051",
    "127.robot.example:50051",
    "localhost.example:50051",
    "[::2]:50051",
  ]) {
    await assert.rejects(connect({ server: address, token: TOKEN }), /in the clear/);
  }
});

test("credentials that can't be used so are refused before a call", async () => {
  await assert.rejects(connect(secured({ tlsKey: "key.pem" })), /need each other/);
  await assert.rejects(connect(secured({ tlsCa: "", tlsKey: "k", tlsCertificate: "c" })), /needs TLS/);
  await assert.rejects(connect(secured({ tlsCa: "no-such-file" })), /no-such-file cannot be read/);
});
