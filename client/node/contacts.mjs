// Lists the links, then prints all contacts of the arm: places in m, forces in N, both in the arm's base frame.
import { patienceS } from "./lib/patience.mjs";
import { name, vector } from "./lib/print.mjs";
import { number, program } from "./lib/program.mjs";
import { utcText } from "./lib/taclink.mjs";

const OPTIONS = {
  count: ["N", "end after so many messages; 0: never", "0"],
  rate: ["HZ", "at most so many messages a second", "10"],
};

function printLinks(arm) {
  console.log(`arm ${arm.name}, server ${arm.server_version}`);
  for (const link of arm.links) {
    const { rate_hz: rate, latency_p50_s: latency } = link.statistics;
    const status = name(link.status, "LINK_STATUS_");
    const reason = link.status_reason && `  ${link.status_reason}`;
    console.log(
      `  ${link.name}: ${status}, ${rate.toFixed(1)} frames/s, latency ${latency.toFixed(4)} s${reason}`,
    );
  }
}

function printContacts(message) {
  const { contacts, total } = message;
  const sum = total ? `${vector(total.force_n, 3)} N` : "not known";
  console.log(`${utcText(message.utc_ns)}  ${contacts.length} contacts, total ${sum}`);
  for (const contact of contacts) {
    const force = vector(contact.wrench.force_n, 3);
    const push = contact.normal_force_n.toFixed(3);
    console.log(
      `  ${contact.link} #${contact.link_contact_id}: ${push} N, force ${force} N at ${vector(contact.center_m, 4)} m`,
    );
  }
}

await program(OPTIONS, async ({ tactile }, options) => {
  const count = number("count", options.count, 0, 1e9);
  const rate = number("rate", options.rate, 0.001, 1000);
  printLinks((await tactile.getArm()).arm);
  let taken = 0;
  // The server says something at least once a second, but never more often than asked for.
  const silenceS = patienceS(5) + 3 / rate;
  for await (const message of tactile.streamContacts({ max_rate_hz: rate }, { silenceS })) {
    printContacts(message);
    if (++taken >= count && count > 0) break;
  }
});
