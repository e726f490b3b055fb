#pragma once

#include <grpcpp/channel.h>

#include <condition_variable>
#include <cstddef>
#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <stop_token>
#include <string>
#include <thread>
#include <vector>

#include "server/base/clock.h"
#include "server/otlp/otlp.pb.h"
#include "server/otlp/span_settings.h"
#include "server/spans/span.h"

namespace stellate::server {

// Sends spans to a collector, by OTLP over gRPC, on a thread of its own. Spans wait for it in a
// queue of bounded length; those that find it full, or that the collector does not take, are
// counted and gone: no mesh ever waits for a collector.
//
//   auto exporter = std::make_shared<SpanExporter>(settings, version, counts);
//   exporter->Take(spans);                         // any thread
//   exporter->Stop(std::chrono::seconds(2));       // sends what waits, no longer than that
class SpanExporter final : public SpanSink {
 public:
  static constexpr std::size_t kMostWaiting = 4096;  // spans
  static constexpr std::size_t kMostOfCall = 512;    // in a call
  static constexpr int kMostAttempts = 4;            // to send the same spans
  // How long a span waits for others.
  static constexpr std::chrono::milliseconds kPatience{1000};

  // What became of spans. Called from any thread; must not block.
  struct Counts {
    std::function<void(std::size_t)> sent, dropped;
  };

  SpanExporter(const SpanSettings& settings, const std::string& version, Counts counts);
  ~SpanExporter() override { Stop({}); }

  void Take(std::vector<Span> spans) override;

  // Sends what waits, until that has taken `limit`; the rest is dropped, and all that comes later.
  void Stop(Clock::duration limit);

 private:
  struct Call;

  void Run();
  bool WaitForSpans(std::unique_lock<std::mutex>* lock);
  std::vector<Span> TakeWaiting();  // (locked)
  void Send(const std::vector<Span>& spans);
  // Nothing: they are there, or never will be. Else why not, where it makes sense to try again.
  std::optional<std::string> TryToSend(const otlp::ExportRequest& request, std::size_t spans);
  bool MayGoOn();
  bool Pause(Clock::duration pause);
  void Drop(std::size_t spans, const std::string& why);

  const SpanSettings settings_;
  const Counts counts_;
  const otlp::ResourceSpans process_;
  const std::shared_ptr<grpc::Channel> channel_;
  std::mutex mutex_;
  std::condition_variable wake_;
  std::vector<Span> waiting_;
  std::optional<TimePoint> stop_by_;  // set: it stops, by then
  TimePoint next_complaint_;          // the thread's alone
  std::thread thread_;
};

}  // namespace stellate::server
