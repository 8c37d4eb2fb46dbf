#include "server/rpc/services/acceptance_service.h"

#include <spdlog/spdlog.h>

#include <boost/asio/post.hpp>
#include <utility>

#include "sensing/core/similar_skin.h"
#include "server/rpc/requests/refusal.h"
#include "server/rpc/requests/request_check.h"
#include "server/rpc/requests/status.h"
#include "server/rpc/requests/who.h"

namespace taclink::server {
namespace {

constexpr double kUsualS = 1;

template <typename Response>
void Answer(Result<v1::Acceptance> result, Response* response, grpc::ServerUnaryReactor* reactor) {
  if (!result) return reactor->Finish(ToGrpc(result.error()));
  *response->mutable_acceptance() = *std::move(result);
  reactor->Finish(grpc::Status::OK);
}

const char* VerdictText(const v1::Acceptance& acceptance) {
  switch (acceptance.report().verdict()) {
    case v1::ACCEPTANCE_VERDICT_PASSED:
      return "passed";
    case v1::ACCEPTANCE_VERDICT_FAILED:
      return "failed";
    default:
      return "undecided";
  }
}

}  // namespace

Result<size_t> AcceptanceService::FindAcceptable(const std::string& name) const {
  const auto link = arm_.FindLink(name);
  if (link && arm_.plays_log())
    return Error{ErrorCode::kFailedPrecondition, "a log is played: its links cannot be measured again"};
  return link;
}

template <typename Request, typename Work>
grpc::ServerUnaryReactor* AcceptanceService::Do(Context* context, const char* call, const Request* request,
                                                Work work) {
  if (const auto good = CheckRequest(*request); !good) return RefuseCall(*context, call, good.error());
  grpc::ServerUnaryReactor* const reactor = context->DefaultReactor();
  boost::asio::post(pool_, [=, work = std::move(work)] { work(reactor); });
  return reactor;
}

grpc::ServerUnaryReactor* AcceptanceService::StartAcceptance(Context* context,
                                                             const v1::StartAcceptanceRequest* request,
                                                             v1::StartAcceptanceResponse* response) {
  return Do(context, "StartAcceptance", request,
            [this, request, response, who = Who(*context, *security_)](grpc::ServerUnaryReactor* reactor) {
              const auto link = FindAcceptable(request->link());
              if (!link) return reactor->Finish(ToGrpc(link.error()));
              auto started =
                  arm_.acceptances().Start(*link, request->plan(), request->plan_text(), request->restart());
              const std::string outcome =
                  started ? "started by plan " + started->plan() : started.error().message;
              arm_.events().Post(EventKind::kAcceptance, *link,
                                 {.who = who, .accepted = started.ok(), .outcome = outcome, .values = {}});
              Answer(std::move(started), response, reactor);
            });
}

Result<void> AcceptanceService::Measure(size_t link, const v1::MeasureTrialRequest& request, Context* context,
                                        v1::MeasureTrialResponse* response,
                                        grpc::ServerUnaryReactor* reactor) {
  AcceptanceStore& store = arm_.acceptances();
  const auto trial = store.Trial(link, request.trial());
  if (!trial) return trial.error();
  std::optional<TrialReference> reference;
  const v1::TrialPhase phase =
      request.phase() == v1::TRIAL_PHASE_UNSPECIFIED ? v1::TRIAL_PHASE_LOADED : request.phase();
  if (phase == v1::TRIAL_PHASE_LOADED) {
    const LinkPose pose = arm_.poses().At(link, arm_.clock().MonotonicNs());
    if (request.reference().in_base_frame() && pose.validity >= PoseValidity::kStale) {
      return Error{
          ErrorCode::kFailedPrecondition,
          "the pose of link '" + arm_.links()[link].name +
              "' is not known now (joint states are missing or old), so that a reference in the base frame "
              "says nothing; send joint states, or the reference in the link's frame"};
    }
    reference = FromWire(request.reference(), pose.base_from_link);
    if (!reference->place_mm) {
      reference->place_mm = trial->reference.place_mm;
      if (!reference->direction) reference->direction = trial->reference.direction;
    }
  }
  const bool is_hold = phase == v1::TRIAL_PHASE_LOADED && trial->kind == TrialKind::kHold;
  MeasurementOptions options{.link = link,
                             .place_mm = reference ? reference->place_mm : trial->reference.place_mm,
                             .near_mm = kSameContactMm * LengthUnit(arm_.links()[link].model),
                             .keeps_held = is_hold,
                             .duration_s = request.duration_s() > 0 ? request.duration_s()
                                           : is_hold                ? trial->hold_s
                                                                    : kUsualS};
  if (!store.Claim(link)) {
    return Error{ErrorCode::kResourceExhausted,
                 "link '" + arm_.links()[link].name + "' is being measured already; wait for that"};
  }
  const auto measurement = TrialMeasurement::Start(
      arm_.hub(), arm_.clock(), pool_, options, [context] { return context->IsCancelled(); },
      [this, link, id = request.trial(), phase, reference, response,
       reactor](const Result<TrialReading>& reading) {
        arm_.acceptances().Release(link);
        if (!reading) return reactor->Finish(ToGrpc(reading.error()));
        Answer(arm_.acceptances().Store(link, id, phase, *reading, reference), response, reactor);
      });
  if (const auto added = measurements_.Add(measurement); !added) measurement->End(added.error());
  return {};
}

grpc::ServerUnaryReactor* AcceptanceService::MeasureTrial(Context* context,
                                                          const v1::MeasureTrialRequest* request,
                                                          v1::MeasureTrialResponse* response) {
  return Do(context, "MeasureTrial", request,
            [this, context, request, response](grpc::ServerUnaryReactor* reactor) {
              const auto link = FindAcceptable(request->link());
              if (!link) return reactor->Finish(ToGrpc(link.error()));
              const auto begun = Measure(*link, *request, context, response, reactor);
              if (!begun) reactor->Finish(ToGrpc(begun.error()));
            });
}

grpc::ServerUnaryReactor* AcceptanceService::SkipTrial(Context* context, const v1::SkipTrialRequest* request,
                                                       v1::SkipTrialResponse* response) {
  return Do(context, "SkipTrial", request, [this, request, response](grpc::ServerUnaryReactor* reactor) {
    const auto link = FindAcceptable(request->link());
    if (!link) return reactor->Finish(ToGrpc(link.error()));
    Answer(arm_.acceptances().Skip(*link, request->trial(), request->reopen()), response, reactor);
  });
}

grpc::ServerUnaryReactor* AcceptanceService::FinishAcceptance(Context* context,
                                                              const v1::FinishAcceptanceRequest* request,
                                                              v1::FinishAcceptanceResponse* response) {
  return Do(context, "FinishAcceptance", request,
            [this, request, response, who = Who(*context, *security_)](grpc::ServerUnaryReactor* reactor) {
              const auto link = FindAcceptable(request->link());
              if (!link) return reactor->Finish(ToGrpc(link.error()));
              auto finished = arm_.acceptances().Finish(*link, request->discard());
              const std::string outcome = !finished            ? finished.error().message
                                          : request->discard() ? "discarded"
                                                               : VerdictText(*finished);
              SPDLOG_INFO("{}: acceptance of link {}: {}", who, request->link(), outcome);
              arm_.events().Post(EventKind::kAcceptance, *link,
                                 {.who = who, .accepted = finished.ok(), .outcome = outcome, .values = {}});
              Answer(std::move(finished), response, reactor);
            });
}

grpc::ServerUnaryReactor* AcceptanceService::GetAcceptance(Context* context,
                                                           const v1::GetAcceptanceRequest* request,
                                                           v1::GetAcceptanceResponse* response) {
  return Do(context, "GetAcceptance", request, [this, request, response](grpc::ServerUnaryReactor* reactor) {
    const auto link = arm_.FindLink(request->link());
    if (!link) return reactor->Finish(ToGrpc(link.error()));
    Answer(arm_.acceptances().Get(*link, request->finished(), request->with_files()), response, reactor);
  });
}

}  // namespace taclink::server
