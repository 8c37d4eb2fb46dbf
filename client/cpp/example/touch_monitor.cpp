// Lists the links of an arm, then prints its contacts for some seconds, through breaks of the connection.
//   touch_monitor [HOST:PORT [SECONDS]]
#include <taclink/client.h>
#include <taclink/follow.h>

#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <string>
#include <thread>

namespace client = taclink::client;
namespace v1 = taclink::v1;

namespace {

void PrintLinks(const v1::Arm& arm) {
  std::printf("%s, server %s\n", arm.name().c_str(), arm.server_version().c_str());
  for (const v1::Link& link : arm.links()) {
    const v1::MarkerGrid& markers = link.model().markers();
    std::printf("  %-12s %-10s %u markers, %.0f mm long\n", link.name().c_str(), client::Name(link.status()),
                markers.paths() * markers.rings(), 1e3 * link.model().length_m());
  }
}

void PrintContacts(const v1::LinkFrame& frame) {
  const auto latency = client::LatencyS(frame);
  for (const v1::Contact& contact : frame.contacts()) {
    const v1::Vector3& f = contact.force_n();
    const v1::Vector3& p = contact.center_m();
    std::printf("%s #%llu: force %+.2f %+.2f %+.2f N at %+.1f %+.1f %+.1f mm", frame.link().c_str(),
                static_cast<unsigned long long>(contact.id()), f.x(), f.y(), f.z(), 1e3 * p.x(), 1e3 * p.y(),
                1e3 * p.z());
    if (latency) std::printf(", %.1f ms after exposure", 1e3 * *latency);
    std::printf("\n");
  }
  std::fflush(stdout);
}

}  // namespace

int main(int argc, char** argv) {
  client::FollowOptions options;
  if (argc > 1) options.address = argv[1];
  const double seconds = argc > 2 ? std::strtod(argv[2], nullptr) : 10;

  auto connection = client::Client::Connect(options.address);
  if (!connection) return std::fprintf(stderr, "%s\n", connection.error().message.c_str()), 1;
  const auto arm = connection->GetArm();
  if (!arm) return std::fprintf(stderr, "%s\n", arm.error().message.c_str()), 1;
  PrintLinks(*arm);

  options.on_disconnected = [](const client::Disconnection& why) {
    std::fprintf(stderr, "%s; attempt %d in %lld ms\n", why.error.message.c_str(), why.attempt,
                 static_cast<long long>(why.delay.count()));
  };
  v1::StreamFramesRequest request;
  request.set_max_rate_hz(5);
  const auto frames = client::FollowFrames(options, request, PrintContacts);
  std::this_thread::sleep_for(std::chrono::duration<double>(seconds));
}
