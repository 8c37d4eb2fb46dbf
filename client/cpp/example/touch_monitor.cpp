// Lists the links of an arm, then prints its contacts for some seconds, through breaks of the connection.
//   touch_monitor [HOST:PORT [SECONDS]]
#include <taclink/client.h>
#include <taclink/follow.h>

#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <string>
#include <thread>

using namespace taclink::client;

namespace {

void PrintLinks(const Arm& arm) {
  std::printf("%s, server %s\n", arm.name.c_str(), arm.server_version.c_str());
  for (const Link& link : arm.links) {
    std::printf("  %-12s %-10s %d markers, %.0f mm long\n", link.name.c_str(), Name(link.status),
                link.model.paths * link.model.rings, 1e3 * link.model.length_m);
  }
}

void PrintContacts(const Frame& frame) {
  for (const Contact& contact : frame.contacts) {
    const Vector3& f = contact.force_n;
    const Vector3& p = contact.center_m;
    std::printf("%s #%llu: force %+.2f %+.2f %+.2f N at %+.1f %+.1f %+.1f mm", frame.link.c_str(),
                static_cast<unsigned long long>(contact.id), f[0], f[1], f[2], 1e3 * p[0], 1e3 * p[1],
                1e3 * p[2]);
    if (const auto latency = frame.latency_s()) std::printf(", %.1f ms after exposure", 1e3 * *latency);
    std::printf("\n");
  }
  std::fflush(stdout);
}

}  // namespace

int main(int argc, char** argv) {
  FollowOptions options;
  if (argc > 1) options.address = argv[1];
  const double seconds = argc > 2 ? std::strtod(argv[2], nullptr) : 10;

  auto client = Client::Connect(options.address);
  if (!client) return std::fprintf(stderr, "%s\n", client.error().message.c_str()), 1;
  const auto arm = client->GetArm();
  if (!arm) return std::fprintf(stderr, "%s\n", arm.error().message.c_str()), 1;
  PrintLinks(*arm);

  options.on_disconnected = [](const Disconnection& why) {
    std::fprintf(stderr, "%s; attempt %d in %lld ms\n", why.error.message.c_str(), why.attempt,
                 static_cast<long long>(why.delay.count()));
  };
  const auto frames = FollowFrames(options, {.max_rate_hz = 5}, PrintContacts);
  std::this_thread::sleep_for(std::chrono::duration<double>(seconds));
}
