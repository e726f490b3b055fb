#include "server/otlp/span_exporter.h"

#include <gmock/gmock.h>
#include <grpcpp/generic/async_generic_service.h>
#include <grpcpp/impl/codegen/proto_utils.h>
#include <grpcpp/server.h>
#include <grpcpp/server_builder.h>
#include <gtest/gtest.h>

#include <atomic>
#include <condition_variable>
#include <fstream>
#include <functional>
#include <iterator>
#include <map>
#include <memory>
#include <mutex>
#include <string>
#include <vector>

#include "tests/server/support/certificates.h"

namespace stellate::server {
namespace {

using namespace std::chrono_literals;
using ::testing::Contains;
using ::testing::Pair;

// A collector in this process, which answers as it is told.
class Collector final : public grpc::CallbackGenericService {
 public:
  // Fills the reply to the request of that number, from 1 on; nothing: never answers.
  using Answer = std::function<std::optional<grpc::Status>(int number, otlp::ExportReply* reply)>;

  explicit Collector(
      Answer answer = [](int, otlp::ExportReply*) { return grpc::Status::OK; },
      std::shared_ptr<grpc::ServerCredentials> credentials = grpc::InsecureServerCredentials())
      : answer_(std::move(answer)) {
    grpc::ServerBuilder builder;
    builder.AddListeningPort("127.0.0.1:0", std::move(credentials), &port_);
    builder.RegisterCallbackGenericService(this);
    server_ = builder.BuildAndStart();
  }
  ~Collector() override { server_->Shutdown(std::chrono::system_clock::now()); }

  int port() const { return port_; }

  std::vector<otlp::ExportRequest> Requests() {
    const std::lock_guard lock(mutex_);
    return requests_;
  }
  std::size_t Spans() {
    std::size_t spans = 0;
    for (const auto& request : Requests()) {
      for (const auto& resource : request.resource_spans()) {
        for (const auto& scope : resource.scope_spans()) {
          spans += static_cast<std::size_t>(scope.spans_size());
        }
      }
    }
    return spans;
  }
  void WaitForRequests(std::size_t n) {
    std::unique_lock lock(mutex_);
    changed_.wait(lock, [&] { return requests_.size() >= n; });
  }
  std::string method() {
    const std::lock_guard lock(mutex_);
    return method_;
  }
  std::multimap<std::string, std::string> headers() {
    const std::lock_guard lock(mutex_);
    return headers_;
  }

  grpc::ServerGenericBidiReactor* CreateReactor(
      grpc::GenericCallbackServerContext* context) override {
    return new Reactor(this, context);
  }

 private:
  class Reactor final : public grpc::ServerGenericBidiReactor {
   public:
    Reactor(Collector* collector, grpc::GenericCallbackServerContext* context)
        : collector_(collector), context_(context) {
      StartRead(&request_);
    }
    void OnReadDone(bool ok) override {
      otlp::ExportReply reply;
      const auto status = ok ? collector_->Take(&request_, context_, &reply)
                             : std::optional(grpc::Status::CANCELLED);
      if (!status) return;  // until it is cancelled
      if (!status->ok()) return Finish(*status);
      bool own_buffer = false;
      grpc::SerializationTraits<otlp::ExportReply>::Serialize(reply, &reply_, &own_buffer);
      StartWriteAndFinish(&reply_, {}, *status);
    }
    void OnCancel() override {
      if (!was_cancelled_.exchange(true) && collector_->answers_nothing_) {
        Finish(grpc::Status::CANCELLED);
      }
    }
    void OnDone() override { delete this; }

   private:
    Collector* const collector_;
    grpc::GenericCallbackServerContext* const context_;
    grpc::ByteBuffer request_, reply_;
    std::atomic<bool> was_cancelled_{false};
  };

  std::optional<grpc::Status> Take(grpc::ByteBuffer* bytes,
                                   grpc::GenericCallbackServerContext* context,
                                   otlp::ExportReply* reply) {
    otlp::ExportRequest request;
    EXPECT_TRUE(grpc::SerializationTraits<otlp::ExportRequest>::Deserialize(bytes, &request).ok());
    int number = 0;
    {
      const std::lock_guard lock(mutex_);
      requests_.push_back(std::move(request));
      number = static_cast<int>(requests_.size());
      method_ = context->method();
      for (const auto& [key, value] : context->client_metadata()) {
        headers_.emplace(std::string(key.data(), key.size()),
                         std::string(value.data(), value.size()));
      }
    }
    auto status = answer_(number, reply);
    if (!status) answers_nothing_ = true;
    changed_.notify_all();
    return status;
  }

  const Answer answer_;
  std::atomic<bool> answers_nothing_{false};
  std::mutex mutex_;
  std::condition_variable changed_;
  std::vector<otlp::ExportRequest> requests_;
  std::string method_;
  std::multimap<std::string, std::string> headers_;
  int port_ = 0;
  std::unique_ptr<grpc::Server> server_;
};

struct Sending {
  explicit Sending(const SpanSettings& settings)
      : exporter(std::make_unique<SpanExporter>(
            settings, "1.2.3",
            SpanExporter::Counts{[this](std::size_t n) { sent += n; },
                                 [this](std::size_t n) { dropped += n; }})) {}
  explicit Sending(int port) : Sending(To(port)) {}

  static SpanSettings To(int port) {
    SpanSettings settings;
    settings.url = {"127.0.0.1:" + std::to_string(port), false, true};
    return settings;
  }

  void Take(std::size_t spans) {
    std::vector<Span> some(spans);
    for (Span& span : some) span.name = "some";
    exporter->Take(std::move(some));
    taken += spans;
  }
  // Nothing is lost uncounted.
  void Stop(Clock::duration limit = 60s) {
    exporter->Stop(limit);
    EXPECT_EQ(sent + dropped, taken);
  }

  std::atomic<std::size_t> sent{0}, dropped{0};
  std::size_t taken = 0;
  std::unique_ptr<SpanExporter> exporter;
};

// Where nothing listens.
int DeadPort() { return std::make_unique<Collector>()->port(); }

TEST(SpanExporter, SendsWhatWaitsBeforeItStops) {
  Collector collector;
  Sending sending(collector.port());
  for (int i = 0; i < 40; ++i) sending.Take(50);
  sending.Stop();
  EXPECT_EQ(sending.sent, 2000u);
  EXPECT_EQ(collector.Spans(), 2000u);
  for (const auto& request : collector.Requests()) {
    EXPECT_LE(request.resource_spans(0).scope_spans(0).spans_size(), 512);
  }
  EXPECT_EQ(collector.method(), "/opentelemetry.proto.collector.trace.v1.TraceService/Export");
}

TEST(SpanExporter, SendsWithoutBeingStopped) {
  Collector collector;
  Sending sending(collector.port());
  sending.Take(1);
  collector.WaitForRequests(1);
  sending.Stop();
}

TEST(SpanExporter, SendsHeadersAndWhoItIs) {
  Collector collector;
  SpanSettings settings = Sending::To(collector.port());
  settings.headers = {{"authorization", "Bearer x,y"}};
  settings.service = "mesher";
  settings.resource = {{"deployment.environment", "test\nbed"}};
  Sending sending(settings);
  sending.Take(1);
  sending.Stop();
  EXPECT_THAT(collector.headers(), Contains(Pair("authorization", "Bearer x,y")));
  std::map<std::string, std::string> says;
  const std::vector<otlp::ExportRequest> requests = collector.Requests();
  for (const auto& pair : requests.at(0).resource_spans(0).resource().attributes()) {
    says[pair.key()] = pair.value().string_value();
  }
  EXPECT_EQ(says["service.name"], "mesher");
  EXPECT_EQ(says["service.version"], "1.2.3");
  EXPECT_EQ(says["deployment.environment"], "test bed");
}

TEST(SpanExporter, TriesAgainWhereACollectorIsAwayForAMoment) {
  Collector collector([](int number, otlp::ExportReply*) {
    return number == 1 ? grpc::Status(grpc::StatusCode::UNAVAILABLE, "later") : grpc::Status::OK;
  });
  Sending sending(collector.port());
  sending.Take(7);
  collector.WaitForRequests(2);
  sending.Stop();
  EXPECT_EQ(sending.sent, 7u);
}

TEST(SpanExporter, DoesNotTryAgainWhereItIsRefused) {
  Collector collector([](int, otlp::ExportReply*) {
    return grpc::Status(grpc::StatusCode::PERMISSION_DENIED, std::string(5000, '\n'));
  });
  Sending sending(collector.port());
  sending.Take(7);
  sending.Stop();
  EXPECT_EQ(sending.dropped, 7u);
  EXPECT_EQ(collector.Requests().size(), 1u);
}

TEST(SpanExporter, CountsWhatACollectorTakesOnlyInPart) {
  for (const auto& [says, dropped] :
       std::map<std::int64_t, std::size_t>{{3, 3}, {-5, 0}, {1'000'000, 7}}) {
    Collector collector([says = says](int, otlp::ExportReply* reply) {
      reply->mutable_partial_success()->set_rejected_spans(says);
      reply->mutable_partial_success()->set_error_message("\x1b[31mno");
      return grpc::Status::OK;
    });
    Sending sending(collector.port());
    sending.Take(7);
    sending.Stop();
    EXPECT_EQ(sending.dropped, dropped) << says;
  }
}

TEST(SpanExporter, TakesNoEndlessReply) {
  Collector collector([](int, otlp::ExportReply* reply) {
    reply->mutable_partial_success()->set_error_message(std::string(1 << 20, 'x'));
    return grpc::Status::OK;
  });
  Sending sending(collector.port());
  sending.Take(7);
  sending.Stop();
  EXPECT_EQ(sending.dropped, 7u);
}

TEST(SpanExporter, KeepsNoMoreThanItsQueueForACollectorThatIsAway) {
  Sending sending(DeadPort());
  for (int i = 0; i < 1000; ++i) sending.Take(10);
  EXPECT_GE(sending.dropped, 10'000u - SpanExporter::kMostWaiting - SpanExporter::kMostOfCall);
  sending.Stop(1ms);
  EXPECT_EQ(sending.dropped, 10'000u);
}

TEST(SpanExporter, StopsThoughACollectorNeverAnswers) {
  Collector collector([](int, otlp::ExportReply*) { return std::nullopt; });
  Sending sending(collector.port());
  sending.Take(600);
  collector.WaitForRequests(1);
  sending.Stop(1ms);
  EXPECT_EQ(sending.dropped, 600u);
  sending.Take(1);
  EXPECT_EQ(sending.dropped, 601u) << "it has stopped";
}

TEST(SpanExporter, TakesAGroupOfSpansWholeOrNotAtAll) {
  Sending sending(DeadPort());
  sending.Take(SpanExporter::kMostWaiting + 1);
  EXPECT_EQ(sending.dropped, SpanExporter::kMostWaiting + 1);
  sending.Stop(1ms);
}

TEST(SpanExporter, SpeaksTlsWithWhomItsAuthorityKnows) {
  const testing::TestAuthority authority, stranger("stranger");
  const std::string server = authority.Issue("server"), client = authority.Issue("client");
  const auto text = [](const std::string& path) { return testing::ReadFile(path); };
  grpc::SslServerCredentialsOptions options(
      GRPC_SSL_REQUEST_AND_REQUIRE_CLIENT_CERTIFICATE_AND_VERIFY);
  options.pem_root_certs = text(authority.certificate());
  options.pem_key_cert_pairs = {{text(server + ".key"), text(server + ".pem")}};
  Collector collector([](int, otlp::ExportReply*) { return grpc::Status::OK; },
                      grpc::SslServerCredentials(options));
  SpanSettings settings = Sending::To(collector.port());
  settings.url.tls = true;
  settings.authority = text(authority.certificate());
  settings.certificate = text(client + ".pem");
  settings.key = text(client + ".key");
  Sending known(settings);
  known.Take(3);
  known.Stop();
  EXPECT_EQ(known.sent, 3u);
  settings.authority = text(stranger.certificate());
  Sending unknown(settings);
  unknown.Take(3);
  unknown.Stop(1s);
  EXPECT_EQ(unknown.dropped, 3u);
  EXPECT_EQ(collector.Spans(), 3u);
}

}  // namespace
}  // namespace stellate::server
