#include "server/publish/nats_connection.h"

#include <nats/nats.h>
#include <pthread.h>

#include <array>
#include <fstream>
#include <mutex>
#include <utility>
#include <vector>

#include "server/security/secret_file.h"

namespace taclink::server {
namespace {

constexpr int64_t kReconnectMs = 500, kReconnectJitterMs = 200;
constexpr int64_t kPingMs = 5000;
constexpr int kPingsOut = 2;
constexpr int64_t kWriteDeadlineMs = 2000;
constexpr int64_t kAnswerMs = 5000;
constexpr int64_t kMaxPending = 8192;  // more than is ever in flight, so that sending never waits
constexpr int64_t kDuplicatesNs = 300'000'000'000;

struct OptionsDeleter {
  void operator()(natsOptions* options) const { natsOptions_Destroy(options); }
};
using OptionsPtr = std::unique_ptr<natsOptions, OptionsDeleter>;

// Threads that are made meanwhile have this name, for top -H and gdb.
class NamesThreads {
 public:
  explicit NamesThreads(const char* name) {
    pthread_getname_np(pthread_self(), own_.data(), own_.size());
    pthread_setname_np(pthread_self(), name);
  }
  ~NamesThreads() { pthread_setname_np(pthread_self(), own_.data()); }
  NamesThreads(const NamesThreads&) = delete;
  NamesThreads& operator=(const NamesThreads&) = delete;

 private:
  std::array<char, 16> own_ = {};
};

Error Wrong(const std::string& what, natsStatus status) {
  const char* const last = nats_GetLastError(nullptr);
  const std::string detail = last != nullptr && last[0] != '\0' ? last : natsStatus_GetText(status);
  return {ErrorCode::kInvalidArgument, "publish: " + what + ": " + detail};
}

Result<std::string> ReadToken(const std::string& file) {
  const auto text = ReadSecretFile("publish.token_file", file);
  if (!text) return text.error();
  std::string token;
  if (!(std::istringstream(*text) >> token))
    return Error{ErrorCode::kNotFound, "publish.token_file: " + file + " holds no token"};
  return token;
}

Result<void> SetSecrets(const PublishConfig& config, natsOptions* options) {
  const auto check = [](const std::string& what, natsStatus status) {
    return status == NATS_OK ? Result<void>() : Result<void>(Wrong(what, status));
  };
  const bool tls = config.url.find("tls://") != std::string::npos || !config.tls_ca.empty();
  Result<void> good;
  if (tls) good = check("TLS", natsOptions_SetSecure(options, true));
  if (good && !config.tls_ca.empty())
    good = check("tls_ca " + config.tls_ca,
                 natsOptions_LoadCATrustedCertificates(options, config.tls_ca.c_str()));
  if (good && !config.key.empty()) good = CheckSecretFile("publish.key", config.key);
  if (good && !config.certificate.empty())
    good = check("certificate " + config.certificate,
                 natsOptions_LoadCertificatesChain(options, config.certificate.c_str(), config.key.c_str()));
  if (good && !config.credentials.empty()) {
    if (const auto text = ReadSecretFile("publish.credentials", config.credentials); !text)
      return text.error();
    good = check("credentials",
                 natsOptions_SetUserCredentialsFromFiles(options, config.credentials.c_str(), nullptr));
  }
  if (good && !config.token_file.empty()) {
    const auto token = ReadToken(config.token_file);
    if (!token) return token.error();
    good = check("token_file", natsOptions_SetToken(options, token->c_str()));
  }
  return good;
}

}  // namespace

// What NATS' threads call. They may do so for a moment after the connection is closed.
struct NatsConnection::State {
  State(PublishConfig publish_config, std::string client_name, Callbacks to_call)
      : config(std::move(publish_config)), name(std::move(client_name)), callbacks(std::move(to_call)) {}

  Result<void> Connect() {
    const auto options = MakeOptions();
    if (!options) return options.error();
    const NamesThreads names("nats");
    const natsStatus connected = natsConnection_Connect(&connection, options->get());
    if (connected != NATS_OK && connected != NATS_NOT_YET_CONNECTED)
      return Wrong("url " + config.url, connected);
    jsOptions stream_options;
    jsOptions_Init(&stream_options);
    stream_options.Wait = kAnswerMs;
    stream_options.PublishAsync.MaxPending = kMaxPending;
    stream_options.PublishAsync.AckHandler = OnAnswer;
    stream_options.PublishAsync.AckHandlerClosure = this;
    const natsStatus made = natsConnection_JetStream(&stream, connection, &stream_options);
    return made == NATS_OK ? Result<void>() : Wrong("JetStream", made);
  }
  void Disconnect() {
    if (connection != nullptr) natsConnection_Close(connection);
    jsCtx_Destroy(std::exchange(stream, nullptr));
    natsConnection_Destroy(std::exchange(connection, nullptr));
  }
  void Silence() {
    const std::lock_guard lock(gate);
    callbacks = {};
  }

  void TellChange() {
    const std::lock_guard lock(gate);
    if (callbacks.changed) callbacks.changed();
  }
  void TellAnswer(const std::string& id, const std::string& error) {
    const std::lock_guard lock(gate);
    if (callbacks.answered) callbacks.answered(id, error);
  }

  void SetTrouble(const std::string& text) {
    const std::lock_guard lock(mutex);
    trouble = text;
  }

  static void OnChange(natsConnection* connection, void* self) {
    const char* last = nullptr;
    natsConnection_GetLastError(connection, &last);
    const bool up = natsConnection_Status(connection) == NATS_CONN_STATUS_CONNECTED;
    auto* const state = static_cast<State*>(self);
    state->SetTrouble(up || last == nullptr ? "" : last);
    state->TellChange();
  }
  static void OnError(natsConnection* connection, natsSubscription*, natsStatus status, void* self) {
    const char* last = nullptr;
    natsConnection_GetLastError(connection, &last);
    static_cast<State*>(self)->SetTrouble(last != nullptr && last[0] != '\0' ? last
                                                                             : natsStatus_GetText(status));
  }
  static void OnAnswer(jsCtx*, natsMsg* message, jsPubAck*, jsPubAckErr* error, void* self) {
    const char* id = nullptr;
    natsMsgHeader_Get(message, "Nats-Msg-Id", &id);
    std::string why;
    if (error != nullptr) why = error->ErrText != nullptr ? error->ErrText : natsStatus_GetText(error->Err);
    if (error != nullptr && why.empty()) why = "not stored";
    if (id != nullptr) static_cast<State*>(self)->TellAnswer(id, why);
    natsMsg_Destroy(message);
  }

  Result<OptionsPtr> MakeOptions() {
    natsOptions* raw = nullptr;
    if (const natsStatus made = natsOptions_Create(&raw); made != NATS_OK) return Wrong("NATS", made);
    OptionsPtr options(raw);
    const std::vector<std::string> urls = SplitUrls(config.url);
    std::vector<const char*> servers;
    servers.reserve(urls.size());
    for (const std::string& url : urls) servers.push_back(url.c_str());
    if (const natsStatus set = natsOptions_SetServers(raw, servers.data(), static_cast<int>(servers.size()));
        set != NATS_OK)
      return Wrong("url " + config.url, set);
    natsOptions_SetName(raw, name.c_str());
    natsOptions_SetMaxReconnect(raw, -1);
    natsOptions_SetReconnectWait(raw, kReconnectMs);
    natsOptions_SetReconnectJitter(raw, kReconnectJitterMs, kReconnectJitterMs);
    natsOptions_SetRetryOnFailedConnect(raw, true, OnChange, this);
    natsOptions_SetReconnectedCB(raw, OnChange, this);
    natsOptions_SetDisconnectedCB(raw, OnChange, this);
    natsOptions_SetErrorHandler(raw, OnError, this);
    natsOptions_SetPingInterval(raw, kPingMs);
    natsOptions_SetMaxPingsOut(raw, kPingsOut);
    natsOptions_SetWriteDeadline(raw, kWriteDeadlineMs);
    if (const auto good = SetSecrets(config, raw); !good) return good.error();
    return options;
  }

  const PublishConfig config;
  const std::string name;
  natsConnection* connection = nullptr;
  jsCtx* stream = nullptr;

  std::mutex gate;
  Callbacks callbacks;  // guarded by gate
  std::mutex mutex;
  std::string trouble;  // guarded by mutex
};

Result<void> CheckPublish(const PublishConfig& config) {
  NatsConnection::State state(config, "", {});
  const auto options = state.MakeOptions();
  return options ? Result<void>() : options.error();
}

NatsConnection::NatsConnection(std::unique_ptr<State> state) : state_(std::move(state)) {}

NatsConnection::~NatsConnection() {
  state_->Disconnect();
  state_->Silence();
  // NATS' threads know no reference counts: what they may still look at is kept.
  static std::mutex mutex;
  static std::vector<std::unique_ptr<State>> closed;
  const std::lock_guard lock(mutex);
  closed.push_back(std::move(state_));
}

Result<std::unique_ptr<NatsConnection>> NatsConnection::Open(const PublishConfig& config,
                                                             const std::string& name, Callbacks callbacks) {
  std::unique_ptr<NatsConnection> out(
      new NatsConnection(std::make_unique<State>(config, name, std::move(callbacks))));
  if (const auto connected = out->state_->Connect(); !connected) return connected.error();
  return out;
}

Result<void> NatsConnection::Reopen() {
  state_->Disconnect();
  return state_->Connect();
}

bool NatsConnection::connected() const {
  return natsConnection_Status(state_->connection) == NATS_CONN_STATUS_CONNECTED;
}

bool NatsConnection::closed() const {
  return natsConnection_Status(state_->connection) == NATS_CONN_STATUS_CLOSED;
}

std::string NatsConnection::trouble() const {
  if (closed())
    return "it refuses this user, or is not who publish.tls_ca lets us trust; see also token_file, "
           "credentials";
  const std::lock_guard lock(state_->mutex);
  if (!state_->trouble.empty()) return state_->trouble;
  const char* last = nullptr;
  natsConnection_GetLastError(state_->connection, &last);
  return last != nullptr ? last : "";
}

Result<void> NatsConnection::PrepareStream() {
  jsErrCode code{};
  jsStreamInfo* info = nullptr;
  const PublishConfig& config = state_->config;
  natsStatus status = js_GetStreamInfo(&info, state_->stream, config.stream.c_str(), nullptr, &code);
  if (status != NATS_OK && code == JSStreamNotFoundErr) {
    const std::string subjects = "taclink." + config.site + ".>";
    std::array<const char*, 1> list = {subjects.c_str()};
    jsStreamConfig stream;
    jsStreamConfig_Init(&stream);
    stream.Name = config.stream.c_str();
    stream.Subjects = list.data();
    stream.SubjectsLen = 1;
    stream.Storage = js_FileStorage;
    stream.MaxBytes = static_cast<int64_t>(config.stream_mb * 1e6);
    stream.Discard = js_DiscardOld;
    stream.Duplicates = kDuplicatesNs;
    status = js_AddStream(&info, state_->stream, &stream, nullptr, &code);
  }
  jsStreamInfo_Destroy(info);
  if (status == NATS_OK) return {};
  const char* const last = nats_GetLastError(nullptr);
  return Error{status == NATS_TIMEOUT || code == 0 ? ErrorCode::kUnavailable : ErrorCode::kFailedPrecondition,
               "stream " + config.stream + ": " +
                   (last != nullptr && last[0] != '\0' ? last : natsStatus_GetText(status)) +
                   "; does that server have JetStream, and this user its permission?"};
}

Result<void> NatsConnection::Send(const OutMessage& message) {
  natsMsg* raw = nullptr;
  const std::string* bytes = message.bytes.get();
  std::string joined;
  if (!message.tail.empty()) bytes = &(joined = *bytes + message.tail);
  natsStatus status =
      natsMsg_Create(&raw, message.subject.c_str(), nullptr, bytes->data(), static_cast<int>(bytes->size()));
  jsPubOptions options;
  jsPubOptions_Init(&options);
  options.MsgId = message.id.c_str();
  options.MaxWait = kAnswerMs;
  if (status == NATS_OK) status = js_PublishMsgAsync(state_->stream, &raw, &options);
  natsMsg_Destroy(raw);  // null where it was taken
  if (status == NATS_OK) return {};
  return Error{ErrorCode::kUnavailable, natsStatus_GetText(status)};
}

}  // namespace taclink::server
