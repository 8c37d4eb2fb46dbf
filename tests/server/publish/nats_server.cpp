#include "tests/server/publish/nats_server.h"

#include <gtest/gtest.h>
#include <unistd.h>

#include <chrono>
#include <csignal>
#include <filesystem>
#include <fstream>
#include <optional>
#include <utility>

namespace taclink::testing {
namespace {

namespace fs = std::filesystem;
using std::chrono::seconds;

constexpr seconds kForever{60};

std::string NewFolder() {
  static int count = 0;
  const std::string folder =
      ::testing::TempDir() + "nats." + std::to_string(getpid()) + "." + std::to_string(++count);
  fs::create_directories(folder);
  return folder;
}

}  // namespace

NatsServer::NatsServer(std::string more, bool jetstream)
    : folder_(NewFolder()), more_(std::move(more)), jetstream_(jetstream) {
  Start();
}

NatsServer::~NatsServer() {
  process_.reset();
  fs::remove_all(folder_);
}

void NatsServer::Start() {
  const std::string config = folder_ + "/server.conf";
  std::ofstream out(config);
  out << "listen: \"127.0.0.1:" << (port_ == 0 ? -1 : port_) << "\"\n" << more_ << "\n";
  if (jetstream_) out << "jetstream { store_dir: \"" << folder_ << "/store\" }\n";
  out.close();
  const std::string mark = "Listening for client connections on 127.0.0.1:";
  std::optional<std::string> line;
  // The port that it had may meanwhile be another program's, for one connection. It must be the same, because
  // clients are to find it there again.
  const auto give_up = std::chrono::steady_clock::now() + kForever;
  do {
    process_ = std::make_unique<Process>(std::vector<std::string>{NATS_SERVER, "-c", config});
    line = process_->ReadUntil(mark, kForever, true);
  } while (!line && port_ != 0 && std::chrono::steady_clock::now() < give_up);
  ASSERT_TRUE(line.has_value()) << "nats-server does not listen";
  port_ = std::stoi(line->substr(line->find(mark) + mark.size()));
  ASSERT_TRUE(process_->ReadUntil("Server is ready", kForever, true).has_value());
}

void NatsServer::Kill() {
  process_->Signal(SIGKILL);
  process_->Wait(kForever);
  process_.reset();
}

std::vector<Stored> ReadStream(const std::string& url, const std::string& stream,
                               const std::function<bool(const std::vector<Stored>&)>& done) {
  natsConnection* connection = nullptr;
  jsCtx* js = nullptr;
  natsSubscription* subscription = nullptr;
  EXPECT_EQ(natsConnection_ConnectTo(&connection, url.c_str()), NATS_OK);
  EXPECT_EQ(natsConnection_JetStream(&js, connection, nullptr), NATS_OK);
  jsSubOptions options;
  jsSubOptions_Init(&options);
  options.Stream = stream.c_str();
  options.Ordered = true;
  EXPECT_EQ(js_SubscribeSync(&subscription, js, "taclink.>", nullptr, &options, nullptr), NATS_OK);
  std::vector<Stored> out;
  natsMsg* message = nullptr;
  while (!done(out) && natsSubscription_NextMsg(&message, subscription, 60'000) == NATS_OK) {
    out.push_back(
        {natsMsg_GetSubject(message),
         std::string(natsMsg_GetData(message), static_cast<size_t>(natsMsg_GetDataLength(message)))});
    natsMsg_Destroy(message);
  }
  // First what reads: the library looks at a subscription while it hands messages to it, with no reference of
  // its own (nats.c before 3.6, its issue 637), and a publisher may be sending still.
  natsConnection_Close(connection);
  natsSubscription_Destroy(subscription);
  jsCtx_Destroy(js);
  natsConnection_Destroy(connection);
  return out;
}

}  // namespace taclink::testing
