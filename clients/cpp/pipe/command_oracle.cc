#include "stellate/command_oracle.h"

#include <algorithm>
#include <atomic>
#include <chrono>
#include <cmath>
#include <condition_variable>
#include <deque>
#include <exception>
#include <mutex>
#include <system_error>
#include <utility>
#include <vector>

#include "pipe/exchange.h"
#include "pipe/framing.h"
#include "pipe/numbers.h"
#include "stellate/connection.h"

namespace stellate {
namespace pipe {
namespace {

using Clock = std::chrono::steady_clock;

constexpr double kUnusual = 4;  // times the longest batch so far: of an oracle that is slow always

// One process, from its first line on.
class Speaker {
  template <typename Do>
  auto Guarded(const std::string& where, const Do& act) {
    try {
      return act();
    } catch (const Ended& e) {
      const std::string how = process_.HowItEnded();
      throw Ended(Sentence(where, e.what() + (": " + how)));
    } catch (const CommandError& e) {
      process_.ReadErrors();
      process_.End(Process::Manner::kNow);
      throw std::runtime_error(Sentence(where, std::string("it says: ") + e.what()));
    } catch (const std::exception& e) {
      process_.ReadErrors();
      process_.End(Process::Manner::kNow);
      throw std::runtime_error(Sentence(where, e.what()));
    }
  }

 public:
  Speaker(const CommandOptions& options, const StopSignal& stop)
      : options_(options), stop_(stop), process_(options.command) {}

  // Throws what went wrong as a runtime_error in whole sentences, or as Ended.
  Greeting Greet() {
    return Guarded("at its first line", [this] {
      Greeting greeting;
      Exchange(
          process_, "",
          [&greeting](std::string* came) {
            const size_t end = came->find('\n');
            const bool fits = MayBecomeGreeting(*came) && came->size() <= kMaxGreetingBytes;
            if (end == std::string::npos && fits) return false;
            greeting = ParseGreeting(std::string_view(*came).substr(0, end));
            came->erase(0, end + 1);
            return true;
          },
          WaitingFor(options_.start_seconds, "the oracle command's first line"), stop_);
      return greeting;
    });
  }

  Answer Ask(const Question& question, bool text) {
    const std::string batch = std::to_string(question.points.cols()) +
                              (question.bases != nullptr ? " flats" : " closest points");
    const std::string awaited = has_answered_ ? "the oracle command's answer to " + batch
                                              : "the oracle command's first answer, to " + batch;
    return Guarded("in a batch of " + batch, [&] {
      const auto asked = Clock::now();
      const std::unique_ptr<AnswerReader> reader = AnswerReader::Make(question, text);
      Exchange(
          process_, ToBytes(question, text),
          [&reader](std::string* came) { return reader->Take(came); },
          WaitingFor(options_.silence_seconds, awaited), stop_);
      has_answered_ = true;
      longest_ = std::max<Seconds>(longest_, Clock::now() - asked);
      return reader->Finish();
    });
  }

  Patience WaitingFor(double silence, const std::string& what) const {
    const Seconds unremarked = std::max(Seconds(options_.unremarked_seconds), kUnusual * longest_);
    if (!options_.on_waiting) return {Seconds(silence), unremarked};
    return {Seconds(silence), unremarked, [this, what](double seconds) {
              options_.on_waiting("waiting for " + what + ", " +
                                  std::to_string(std::lround(seconds)) + " s");
            }};
  }

  // Its end may come: it is not waited for.
  void Dismiss() { process_.input.Close(); }
  bool has_answered() const { return has_answered_; }
  bool ended_well() const { return process_.ended_well(); }

 private:
  std::string Sentence(const std::string& where, const std::string& what) const {
    return "the oracle command " + Quoted(options_.command) + ", " + where + ": " + what +
           process_.LastErrors();
  }

  const CommandOptions& options_;
  const StopSignal& stop_;
  Process process_;
  bool has_answered_ = false;
  Seconds longest_{0};  // that a batch took
};

bool Same(const Greeting& a, const Greeting& b) {
  return a.text == b.text && a.dimension == b.dimension &&
         a.ambient_dimension == b.ambient_dimension && a.tangents == b.tangents &&
         a.flats == b.flats && a.sizes == b.sizes && a.walls == b.walls;
}

class CommandOracle final : public Oracle {
 public:
  explicit CommandOracle(CommandOptions options)
      : options_(std::move(options)), stop_(options_.stop) {}

  // All may end at the same time.
  ~CommandOracle() override {
    for (const auto& speaker : idle_) speaker->Dismiss();
  }

  // Starts all processes, and then hears them.
  Expected<void> Start() {
    try {
      for (int i = 0; i < options_.processes; ++i) {
        idle_.push_back(std::make_unique<Speaker>(options_, stop_));
      }
      greeting_ = idle_.front()->Greet();
      for (size_t i = 1; i < idle_.size(); ++i) HearAgain(*idle_[i]);
    } catch (const std::exception& e) {
      return Fail(ErrorCode::kOracleFailed, e.what(), "ORACLE_COMMAND");
    }
    return Settle();
  }

  int dimension() const override { return *options_.dimension; }
  int ambient_dimension() const override { return *options_.ambient_dimension; }
  bool has_intersect_flat() const override { return greeting_.flats; }
  bool has_tangent_basis() const override { return greeting_.tangents; }
  bool has_local_size() const override { return greeting_.sizes; }
  std::optional<BoundingBox> bounding_box() const override { return options_.box; }
  Eigen::MatrixXd seeds() const override { return options_.seeds; }
  std::string about() const override { return greeting_.about; }

  Answer ClosestPoint(const Eigen::MatrixXd& x) override { return Ask({dimension(), x}); }

  Answer IntersectFlat(const Eigen::MatrixXd& centers, const Eigen::MatrixXd& bases,
                       const Eigen::VectorXd& radii) override {
    return Ask({dimension(), centers, &bases, &radii});
  }

  int walls() const override { return greeting_.walls; }

  Answer FacePoint(const Eigen::MatrixXd& x, const Walls& face) override {
    Question question{dimension(), x};
    question.face = face;
    return Ask(std::move(question));
  }

  Eigen::MatrixXd Clearances(const Eigen::MatrixXd& points) override {
    return AskAllFound({dimension(), points}, "clearances").clearances;
  }

  Eigen::MatrixXd Conormals(const Eigen::MatrixXd& points, const Walls& face) override {
    Question question{dimension(), points};
    question.face = face;
    return AskAllFound(std::move(question), "conormals").conormals;
  }

  Eigen::MatrixXd TangentBasis(const Eigen::MatrixXd& points) override {
    return AskAllFound({dimension(), points}, "tangents").tangents;
  }

  Eigen::VectorXd LocalSize(const Eigen::MatrixXd& points) override {
    wants_sizes_ = true;
    return AskAllFound({dimension(), points}, "sizes").sizes;
  }

 private:
  Answer AskAllFound(Question question, const char* what) {
    const Eigen::MatrixXd& points = question.points;
    Answer answer = Ask(std::move(question));
    for (Eigen::Index j = 0; j < points.cols(); ++j) {
      if (answer.IsFound(j)) continue;
      throw std::runtime_error(
          "the oracle command " + Quoted(options_.command) + " was asked for " + what +
          " at points that it gave itself, and in row " + std::to_string(j + 1) + " of " +
          std::to_string(points.cols()) + " it finds no closest point");
    }
    return answer;
  }

  Answer Nothing(const Question& question) const {
    const Eigen::Index conormals = std::ssize(question.face) * question.points.rows();
    return {
        question.points, {}, {}, {}, Eigen::MatrixXd(walls(), 0), Eigen::MatrixXd(conormals, 0)};
  }

  // Tangent bases come along with every answer, from the first: at points that a command found it
  // may round them otherwise, and the mesh would depend on which command answers what first. Sizes,
  // which few meshes need, do once they were asked for: one batch instead of two.
  Answer Ask(Question question) {
    if (question.points.cols() == 0) return Nothing(question);
    question.tangents = greeting_.tangents;
    question.sizes = greeting_.sizes && wants_sizes_;
    question.walls = greeting_.walls;
    std::unique_ptr<Speaker> speaker = Take();
    try {
      Answer answer = AskOrRestart(question, &speaker);
      Give(std::move(speaker));
      return answer;
    } catch (...) {
      Give(nullptr);
      throw;
    }
  }

  Answer AskOrRestart(const Question& question, std::unique_ptr<Speaker>* speaker) {
    try {
      return (*speaker)->Ask(question, greeting_.text);
    } catch (const Ended& e) {
      if (!(*speaker)->has_answered()) throw;
      if (!(*speaker)->ended_well() && options_.on_restart) options_.on_restart(e.what());
    }
    *speaker = std::make_unique<Speaker>(options_, stop_);
    HearAgain(**speaker);
    return (*speaker)->Ask(question, greeting_.text);
  }

  void HearAgain(Speaker& speaker) const {
    if (Same(speaker.Greet(), greeting_)) return;
    throw std::runtime_error("the oracle command " + Quoted(options_.command) +
                             " says another first line when it is started again");
  }

  // In turn, so that what differs between processes is seen.
  std::unique_ptr<Speaker> Take() {
    std::unique_lock lock(mutex_);
    wake_.wait(lock, [this] { return failed_ || !idle_.empty(); });
    if (failed_) std::rethrow_exception(failed_);
    std::unique_ptr<Speaker> speaker = std::move(idle_.front());
    idle_.pop_front();
    return speaker;
  }

  // Null: it failed, as the current exception says. Then the whole oracle has.
  void Give(std::unique_ptr<Speaker> speaker) {
    const std::lock_guard lock(mutex_);
    if (speaker != nullptr) {
      idle_.push_back(std::move(speaker));
    } else if (!failed_) {
      failed_ = std::current_exception();
    }
    wake_.notify_all();
  }

  // The options and the command's first line become one.
  Expected<void> Settle() {
    if (auto ok = Agree("k", greeting_.dimension, &options_.dimension); !ok) return ok;
    if (auto ok = Agree("d", greeting_.ambient_dimension, &options_.ambient_dimension); !ok) {
      return ok;
    }
    const int k = dimension(), d = ambient_dimension();
    if (k < 1 || k > d || (k == d && walls() == 0)) {
      return Fail(ErrorCode::kRefused,
                  "the dimension k = " + std::to_string(k) +
                      " has to be at least 1 and less than d = " + std::to_string(d));
    }
    if (walls() > 0 && !has_tangent_basis()) {
      return Fail(ErrorCode::kRefused,
                  "an oracle with walls takes tangents: walls= goes with tangents=1");
    }
    if (!options_.box && options_.seeds.size() == 0) {
      options_.box = greeting_.box;
      options_.seeds = greeting_.seeds;
    }
    if ((options_.box && options_.box->lower.size() != d) ||
        (options_.seeds.size() > 0 && options_.seeds.rows() != d)) {
      return Fail(ErrorCode::kRefused,
                  "the box and the seeds need d = " + std::to_string(d) + " coordinates");
    }
    if (!options_.box && options_.seeds.size() == 0) {
      return Fail(ErrorCode::kRefused,
                  "where the manifold is, neither box nor seeds say: give one, or have the "
                  "command's first line say it");
    }
    return {};
  }

  static Expected<void> Agree(const std::string& name, const std::optional<int>& said,
                              std::optional<int>* given) {
    if (!said && !*given) {
      return Fail(ErrorCode::kRefused,
                  "what " + name + " is, neither the options nor the command's first line say");
    }
    if (said && *given && *said != **given) {
      return Fail(ErrorCode::kRefused, "the command's first line says " + name + "=" +
                                           std::to_string(*said) + ", and the options " +
                                           std::to_string(**given));
    }
    if (said) *given = said;
    return {};
  }

  CommandOptions options_;
  const StopSignal stop_;
  Greeting greeting_;
  std::atomic<bool> wants_sizes_ = false;
  std::mutex mutex_;
  std::condition_variable wake_;
  std::deque<std::unique_ptr<Speaker>> idle_;
  std::exception_ptr failed_;
};

}  // namespace
}  // namespace pipe

Expected<std::unique_ptr<Oracle>> StartCommand(const CommandOptions& options) {
  constexpr int kMostProcesses = 1024;
  if (options.command.empty()) return Fail(ErrorCode::kRefused, "the oracle command is empty");
  if (options.processes < 1 || options.processes > kMostProcesses) {
    return Fail(ErrorCode::kRefused,
                "the number of processes has to be from 1 to " + std::to_string(kMostProcesses));
  }
  if (!(options.start_seconds > 0) || !(options.silence_seconds > 0) ||
      !(options.unremarked_seconds > 0)) {
    return Fail(ErrorCode::kRefused, "the seconds that a command has must be positive");
  }
  auto oracle = std::make_unique<pipe::CommandOracle>(options);
  if (const Expected<void> started = oracle->Start(); !started) {
    return tl::unexpected(started.error());
  }
  return oracle;
}

}  // namespace stellate
