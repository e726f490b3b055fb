#include "server/otlp/span_exporter.h"

#include <grpcpp/client_context.h>
#include <grpcpp/create_channel.h>
#include <grpcpp/generic/generic_stub.h>
#include <grpcpp/impl/codegen/proto_utils.h>
#include <grpcpp/security/credentials.h>
#include <grpcpp/support/channel_arguments.h>

#include <algorithm>
#include <iterator>
#include <new>
#include <utility>

#include "core/base/message.h"
#include "server/base/log.h"
#include "server/otlp/encode.h"
#include "text/printable.h"

namespace stellate::server {
namespace {

constexpr char kMethod[] = "/opentelemetry.proto.collector.trace.v1.TraceService/Export";
constexpr int kMostReply = 64 << 10;  // bytes: a collector has little to say
constexpr int kLongestPause = 5000;   // ms, between attempts to connect
constexpr auto kFirstPause = std::chrono::milliseconds(500);
constexpr auto kComplaints = std::chrono::seconds(60);  // no more than one
constexpr std::size_t kMostWords = 200;                 // of a collector's, in the log

std::shared_ptr<grpc::Channel> ChannelTo(const SpanSettings& settings) {
  grpc::ChannelArguments arguments;
  arguments.SetMaxReceiveMessageSize(kMostReply);
  arguments.SetInt(GRPC_ARG_MAX_METADATA_SIZE, kMostReply);
  arguments.SetInt(GRPC_ARG_MAX_RECONNECT_BACKOFF_MS, kLongestPause);
  if (settings.url.is_local) arguments.SetInt(GRPC_ARG_ENABLE_HTTP_PROXY, 0);
  const auto credentials =
      settings.url.tls
          ? grpc::SslCredentials({settings.authority, settings.key, settings.certificate})
          : grpc::InsecureChannelCredentials();
  return grpc::CreateCustomChannel(settings.url.target, credentials, arguments);
}

// As OTLP has it.
bool IsWorthAnotherAttempt(grpc::StatusCode code) {
  switch (code) {
    case grpc::StatusCode::CANCELLED:
    case grpc::StatusCode::DEADLINE_EXCEEDED:
    case grpc::StatusCode::ABORTED:
    case grpc::StatusCode::OUT_OF_RANGE:
    case grpc::StatusCode::UNAVAILABLE:
    case grpc::StatusCode::DATA_LOSS:
      return true;
    default:
      return false;
  }
}

}  // namespace

struct SpanExporter::Call {
  grpc::ClientContext context;
  otlp::ExportReply reply;
  std::optional<grpc::Status> status;  // once it is over; with the exporter's lock
};

SpanExporter::SpanExporter(const SpanSettings& settings, const std::string& version, Counts counts)
    : settings_(settings),
      counts_(std::move(counts)),
      process_(DescribeProcess(settings, version)),
      channel_(ChannelTo(settings)),
      thread_([this] { Run(); }) {}

void SpanExporter::Take(std::vector<Span> spans) {
  const std::size_t count = spans.size();
  bool is_due = false;
  {
    const std::lock_guard lock(mutex_);
    if (!stop_by_ && waiting_.size() + count <= kMostWaiting) {
      std::move(spans.begin(), spans.end(), std::back_inserter(waiting_));
      is_due = waiting_.size() == count || waiting_.size() >= kMostOfCall;
    } else {
      counts_.dropped(count);
    }
  }
  if (is_due) wake_.notify_all();
}

void SpanExporter::Stop(Clock::duration limit) {
  {
    const std::lock_guard lock(mutex_);
    if (!stop_by_) stop_by_ = Clock::now() + limit;
  }
  wake_.notify_all();
  if (thread_.joinable()) thread_.join();
}

// For others to come, so that they go together. False: it stops, and nothing waits.
bool SpanExporter::WaitForSpans(std::unique_lock<std::mutex>* lock) {
  wake_.wait(*lock, [this] { return stop_by_ || !waiting_.empty(); });
  wake_.wait_for(*lock, kPatience, [this] { return stop_by_ || waiting_.size() >= kMostOfCall; });
  return !waiting_.empty();
}

std::vector<Span> SpanExporter::TakeWaiting() {
  const auto end =
      waiting_.begin() + static_cast<std::ptrdiff_t>(std::min(kMostOfCall, waiting_.size()));
  std::vector<Span> spans(std::make_move_iterator(waiting_.begin()), std::make_move_iterator(end));
  waiting_.erase(waiting_.begin(), end);
  return spans;
}

void SpanExporter::Run() {
  std::unique_lock lock(mutex_);
  while (WaitForSpans(&lock)) {
    const std::vector<Span> spans = TakeWaiting();
    lock.unlock();
    try {
      Send(spans);
    } catch (const std::bad_alloc&) {
      Drop(spans.size(), "the server is out of memory");
    }
    lock.lock();
  }
}

void SpanExporter::Send(const std::vector<Span>& spans) {
  otlp::ExportRequest request;
  otlp::ResourceSpans& all = *request.add_resource_spans();
  all = process_;
  ToOtlp(spans, all.mutable_scope_spans(0));
  Clock::duration pause = kFirstPause;
  std::string why = "the server stops";
  for (int attempt = 1; MayGoOn(); ++attempt, pause *= 2) {
    const auto trouble = TryToSend(request, spans.size());
    if (!trouble) return;
    why = *trouble;
    if (attempt == kMostAttempts || !Pause(pause)) break;
  }
  Drop(spans.size(), why);
}

std::optional<std::string> SpanExporter::TryToSend(const otlp::ExportRequest& request,
                                                   std::size_t spans) {
  Call call;  // gRPC has it for as long as `is_over` is waited for
  for (const auto& [key, value] : settings_.headers) call.context.AddMetadata(key, value);
  {
    const std::lock_guard lock(mutex_);
    const auto left = stop_by_ ? *stop_by_ - Clock::now() : Clock::duration(settings_.timeout);
    call.context.set_deadline(std::chrono::system_clock::now() +
                              std::chrono::duration_cast<std::chrono::system_clock::duration>(
                                  std::min(left, Clock::duration(settings_.timeout))));
  }
  grpc::TemplatedGenericStub<otlp::ExportRequest, otlp::ExportReply> stub(channel_);
  stub.UnaryCall(&call.context, kMethod, {}, &request, &call.reply,
                 [this, &call](grpc::Status status) {
                   const std::lock_guard lock(mutex_);
                   call.status = std::move(status);
                   wake_.notify_all();
                 });
  std::unique_lock lock(mutex_);
  const auto is_over = [&call] { return call.status.has_value(); };
  wake_.wait(lock, [&] { return is_over() || stop_by_; });
  if (!is_over() && !wake_.wait_until(lock, *stop_by_, is_over)) call.context.TryCancel();
  wake_.wait(lock, is_over);  // its deadline bounds it, or that it is cancelled
  lock.unlock();
  const grpc::Status& status = *call.status;
  const std::string words = text::Printable(status.error_message().substr(0, kMostWords));
  if (!status.ok()) {
    if (IsWorthAnotherAttempt(status.error_code())) return words;
    Drop(spans, words);
    return std::nullopt;
  }
  const auto& partly = call.reply.partial_success();
  const auto rejected =
      std::min(spans, static_cast<std::size_t>(std::max<std::int64_t>(partly.rejected_spans(), 0)));
  if (rejected > 0) Drop(rejected, text::Printable(partly.error_message().substr(0, kMostWords)));
  counts_.sent(spans - rejected);
  return std::nullopt;
}

bool SpanExporter::MayGoOn() {
  const std::lock_guard lock(mutex_);
  return !stop_by_ || Clock::now() < *stop_by_;
}

// False: it stops, and there is no time for another attempt.
bool SpanExporter::Pause(Clock::duration pause) {
  std::unique_lock lock(mutex_);
  if (wake_.wait_for(lock, pause, [this] { return stop_by_.has_value(); })) {
    return Clock::now() < *stop_by_ &&
           !wake_.wait_for(lock, kFirstPause, [this] { return Clock::now() >= *stop_by_; });
  }
  return true;
}

void SpanExporter::Drop(std::size_t spans, const std::string& why) {
  counts_.dropped(spans);
  const TimePoint now = Clock::now();
  if (now < next_complaint_) return;
  next_complaint_ = now + kComplaints;
  Log(LogLevel::kWarning, {}, "spans are dropped: the collector does not take them",
      LogFields().Add("collector", settings_.url.target).Add("why", why));
}

}  // namespace stellate::server
