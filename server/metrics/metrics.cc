#include "server/metrics/metrics.h"

#include <prometheus/counter.h>
#include <prometheus/gauge.h>
#include <prometheus/histogram.h>
#include <prometheus/metric_family.h>
#include <prometheus/registry.h>
#include <prometheus/text_serializer.h>

#include <map>
#include <utility>

#include "core/base/message.h"
#include "server/metrics/counts.h"
#include "server/metrics/front_page.h"
#include "server/metrics/page_server.h"
#include "server/metrics/process_metrics.h"

namespace stellate::server {
namespace {

using prometheus::Counter;
using prometheus::MetricFamily;

// From a native oracle on loopback to a slow one far away.
const prometheus::Histogram::BucketBoundaries kLatencyBuckets = {
    0.001, 0.0025, 0.005, 0.01, 0.025, 0.05, 0.1, 0.25, 0.5, 1, 2.5, 5, 10, 30, 60};

constexpr SessionState kStates[] = {SessionState::kWaiting,   SessionState::kRunning,
                                    SessionState::kSucceeded, SessionState::kStopped,
                                    SessionState::kCancelled, SessionState::kFailed};

MetricFamily Gauge(const char* name, const char* help) {
  MetricFamily family;
  family.name = name;
  family.help = help;
  family.type = prometheus::MetricType::Gauge;
  return family;
}

void Add(MetricFamily* family, double value, const char* label = nullptr,
         const std::string& label_value = "") {
  prometheus::ClientMetric metric;
  if (label != nullptr) metric.label.push_back({label, label_value});
  metric.gauge.value = value;
  family->metric.push_back(std::move(metric));
}

// Gauges, counted from the meshes that the server holds.
class Census final : public prometheus::Collectable {
 public:
  explicit Census(Metrics::Sessions sessions) : sessions_(std::move(sessions)) {}

  std::vector<MetricFamily> Collect() const override {
    const Counts counts = CountAll(sessions_());
    std::vector<MetricFamily> families = {
        Gauge("stellate_meshes", "Meshes that the server holds, by state"),
        Gauge("stellate_workers", "Open worker streams that serve a mesh"),
        Gauge("stellate_watchers", "Open watcher streams"),
        Gauge("stellate_vertices", "Vertices of the meshes that the server holds"),
        Gauge("stellate_queries_waiting", "Queries of the rounds under way, not answered yet"),
        Gauge("stellate_mesh_bytes", "Memory of the meshes that the server holds, estimated"),
        Gauge("stellate_meshes_idle", "Meshes that have questions and no worker")};
    for (const auto& [state, count] : counts.states)
      Add(&families[0], static_cast<double>(count), "state", SessionStateName(state));
    std::size_t next = 1;
    for (const std::uint64_t count : {counts.workers, counts.watchers, counts.vertices,
                                      counts.waiting, counts.bytes, counts.idle})
      Add(&families[next++], static_cast<double>(count));
    return families;
  }

 private:
  const Metrics::Sessions sessions_;
};

}  // namespace

// Sessions hold it as their observer and may outlive Metrics.
class Metrics::Impl final : public SessionObserver {
 public:
  Impl() {
    auto& family = prometheus::BuildCounter()
                       .Name("stellate_meshes_ended_total")
                       .Help("Meshes that ended, by the state they ended in")
                       .Register(*registry);
    for (const SessionState state : kStates) {
      if (state == SessionState::kWaiting || state == SessionState::kRunning) continue;
      ended[state] = &family.Add({{"state", SessionStateName(state)}});
    }
  }

  void OnRound(std::size_t queries) override {
    rounds.Increment();
    answered_queries.Increment(static_cast<double>(queries));
  }

  void OnPoints(std::size_t count) override { points.Increment(static_cast<double>(count)); }

  void OnEnd(SessionState state, const core::Report& report) override {
    ended.at(state)->Increment();
    (report.certificate.certified ? certified : uncertified).Increment();
  }

  void OnHedged(std::size_t chunks) override { hedged.Increment(static_cast<double>(chunks)); }
  void OnCompared(std::size_t queries) override {
    compared.Increment(static_cast<double>(queries));
  }
  void OnDisagreement() override { disagreements.Increment(); }

  Counter& Count(const char* name, const char* help) {
    return prometheus::BuildCounter().Name(name).Help(help).Register(*registry).Add({});
  }

  const std::shared_ptr<prometheus::Registry> registry = std::make_shared<prometheus::Registry>();
  std::map<SessionState, Counter*> ended;
  Counter& rounds = Count("stellate_rounds_total", "Rounds of refinement that were answered");
  Counter& answered_queries =
      Count("stellate_queries_total", "Oracle queries of the rounds that were answered");
  Counter& points =
      Count("stellate_points_total", "Points of reconstructions that were received and recorded");
  Counter& hedged =
      Count("stellate_hedged_chunks_total", "Overdue chunks that an idle worker received as well");
  Counter& compared = Count("stellate_compared_queries_total",
                            "Queries that two workers answered and that were compared");
  Counter& disagreements = Count("stellate_disagreements_total",
                                 "Times that two workers answered one query differently");
  Counter& received = Count("stellate_received_bytes_total", "Bytes of stream messages received");
  Counter& sent = Count("stellate_sent_bytes_total", "Bytes of stream messages sent");
  Counter& spans_sent =
      Count("stellate_spans_sent_total", "Spans of meshes that the collector took");
  Counter& spans_dropped = Count("stellate_spans_dropped_total",
                                 "Spans of meshes that found no room, or that no collector took");
  Counter& refused =
      Count("stellate_unauthenticated_total", "Calls refused because they had no valid token");
  prometheus::Family<Counter>& certificates =
      prometheus::BuildCounter()
          .Name("stellate_certificates_total")
          .Help("Meshes that ended, by what their certificate says")
          .Register(*registry);
  Counter& certified = certificates.Add({{"certified", "true"}});
  Counter& uncertified = certificates.Add({{"certified", "false"}});
  prometheus::Family<Counter>& limits =
      prometheus::BuildCounter()
          .Name("stellate_limit_refusals_total")
          .Help("Calls refused as a limit was reached, by the setting that bounds it")
          .Register(*registry);
  prometheus::Gauge& database =
      prometheus::BuildGauge()
          .Name("stellate_database_up")
          .Help("1 while the database of the meshes' records answers, or where there is none")
          .Register(*registry)
          .Add({}, 1);
  prometheus::Gauge& servers =
      prometheus::BuildGauge()
          .Name("stellate_servers")
          .Help("Servers that share the database of the meshes' records, this one among them")
          .Register(*registry)
          .Add({}, 1);
  Counter& taken_up =
      Count("stellate_meshes_taken_up_total", "Meshes taken up from servers that were gone");
  Counter& passed_on =
      Count("stellate_calls_passed_on_total", "Calls passed on to the server that has their mesh");
  prometheus::Histogram& latency =
      prometheus::BuildHistogram()
          .Name("stellate_answer_seconds")
          .Help("From handing a chunk of queries to a worker's stream to its answer")
          .Register(*registry)
          .Add({}, kLatencyBuckets);

  std::shared_ptr<Census> census;
  const std::shared_ptr<ProcessMetrics> process = std::make_shared<ProcessMetrics>();
  std::unique_ptr<PageServer> pages;

  Page PageAt(std::string_view path, const Sessions& sessions, const WhyNot& why_not) const {
    if (path == "/metrics") {
      std::vector<MetricFamily> families = registry->Collect();
      for (const prometheus::Collectable* some :
           {static_cast<const prometheus::Collectable*>(census.get()),
            static_cast<const prometheus::Collectable*>(process.get())})
        for (MetricFamily& family : some->Collect()) families.push_back(std::move(family));
      return {200, "text/plain; version=0.0.4; charset=utf-8",
              prometheus::TextSerializer().Serialize(families)};
    }
    if (path == "/healthz") {
      const std::string why = why_not();
      if (why.empty()) return {200, "text/plain; charset=utf-8", "serving\n"};
      return {503, "text/plain; charset=utf-8", "no new meshes are taken: " + why + "\n"};
    }
    if (path == "/")
      return {200, "text/html; charset=utf-8", FrontPage(CountAll(sessions()), why_not())};
    return {404, "text/plain; charset=utf-8", "there are /, /healthz and /metrics\n"};
  }
};

Metrics::Metrics() : impl_(std::make_shared<Impl>()) {}
Metrics::~Metrics() { StopListening(); }

core::Status Metrics::Listen(const std::string& address, Sessions sessions, WhyNot why_not) {
  impl_->census = std::make_shared<Census>(sessions);
  auto listening = PageServer::Listen(
      address, [impl = impl_.get(), sessions = std::move(sessions), why_not = std::move(why_not)](
                   std::string_view path) { return impl->PageAt(path, sessions, why_not); });
  if (!listening) {
    return {core::StatusCode::kFailedPrecondition,
            core::Message("cannot listen on ", address, ": ", listening.error().message,
                          "; choose another --metrics-listen")};
  }
  impl_->pages = std::move(*listening);
  return core::Status::Ok();
}

int Metrics::port() const { return impl_->pages == nullptr ? 0 : impl_->pages->port(); }

void Metrics::StopListening() { impl_->pages.reset(); }

std::shared_ptr<SessionObserver> Metrics::observer() const { return impl_; }

void Metrics::Answered(double seconds) { impl_->latency.Observe(seconds); }
void Metrics::DatabaseAnswers(bool yes) { impl_->database.Set(yes ? 1 : 0); }
void Metrics::Share(std::size_t servers) { impl_->servers.Set(static_cast<double>(servers)); }
void Metrics::TakenUp(std::size_t meshes) {
  impl_->taken_up.Increment(static_cast<double>(meshes));
}
void Metrics::PassedOn() { impl_->passed_on.Increment(); }
void Metrics::Refused() { impl_->refused.Increment(); }
void Metrics::LimitReached(const std::string& setting) {
  impl_->limits.Add({{"limit", setting}}).Increment();
}
std::function<void(std::size_t)> Metrics::SpansSent() const {
  return
      [impl = impl_](std::size_t spans) { impl->spans_sent.Increment(static_cast<double>(spans)); };
}
std::function<void(std::size_t)> Metrics::SpansDropped() const {
  return [impl = impl_](std::size_t spans) {
    impl->spans_dropped.Increment(static_cast<double>(spans));
  };
}
void Metrics::Received(std::size_t bytes) { impl_->received.Increment(static_cast<double>(bytes)); }
void Metrics::Sent(std::size_t bytes) { impl_->sent.Increment(static_cast<double>(bytes)); }

}  // namespace stellate::server
