#include "server/rpc/services/tare_call.h"

#include <utility>

#include "server/rpc/requests/status.h"
#include "wire/units.h"

namespace taclink::server {
namespace {

void Fill(const Result<TareSummary>& answer, v1::LinkTare& out) {
  out.set_accepted(answer.ok());
  if (!answer) return out.set_reason(answer.error().message);
  out.set_forced(answer->forced);
  out.set_undone(answer->undone);
  out.set_frames(static_cast<uint32_t>(answer->frames));
  out.set_shift_m(answer->shift_mm * wire::kMetresPerMm);
  out.set_previous_age_s(answer->previous_age_s);
}

}  // namespace

TareCall::TareCall(const std::vector<std::string>& links, v1::TareResponse* response,
                   grpc::ServerUnaryReactor* reactor)
    : response_(response), reactor_(reactor), open_(links.size()) {
  for (const std::string& link : links) response_->add_links()->set_link(link);
}

void TareCall::Answer(size_t place, const Result<TareSummary>& answer) {
  grpc::ServerUnaryReactor* reactor = nullptr;
  {
    const std::lock_guard lock(mutex_);
    if (reactor_ == nullptr) return;
    Fill(answer, *response_->mutable_links(static_cast<int>(place)));
    if (--open_ > 0) return;
    reactor = std::exchange(reactor_, nullptr);
  }
  reactor->Finish(grpc::Status::OK);
}

void TareCall::End(const Error& why) {
  grpc::ServerUnaryReactor* reactor = nullptr;
  {
    const std::lock_guard lock(mutex_);
    reactor = std::exchange(reactor_, nullptr);
  }
  if (reactor != nullptr) reactor->Finish(ToGrpc(why));
}

}  // namespace taclink::server
