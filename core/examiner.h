#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "core/batch.h"
#include "core/report.h"
#include "core/specification.h"
#include "core/status.h"

namespace stellate::core {

enum class Severity {
  kError,    // a mesh will be wrong
  kWarning,  // it may be wrong
  kNote,     // worth knowing
};
const char* SeverityName(Severity severity);  // "error", ...

// One result of an examination.
struct Finding {
  Severity severity = Severity::kNote;
  std::string code;       // stable, e.g. "NOT_CLOSEST"
  std::string message;    // what is wrong, with the first counterexample
  std::string advice;     // what to do; may be empty
  Eigen::VectorXd place;  // the counterexample, a point of R^d; or empty
  std::vector<std::pair<std::string, double>> numbers;  // of the message, by name
};

// How fast an oracle answered batches of one size.
struct BatchRate {
  int batch = 0;                  // queries
  double queries_per_second = 0;  // in the best of several trials
};

// All that an examination found. Lengths are in the coordinates' unit.
struct ExaminationReport {
  std::vector<Finding> findings;  // errors first, then warnings, then notes; one of a kind
  std::uint64_t samples = 0;      // points of M found
  std::uint64_t queries = 0;      // asked of the oracle, those that measure its speed excluded
  std::optional<double> reach;    // an estimate from above
  std::optional<int> pieces;      // components with at least one of these points
  std::vector<BatchRate> rates;   // by ascending batch; none where the time was not measured
  int best_batch = 0;             // queries; 0: not known

  bool ok() const;  // no error among the findings
};

// Returns a report in several lines, for people; each ends with "\n".
std::string ToText(const ExaminationReport& report);

// The epsilon that "auto" stands for: a quarter of the reach, to two digits.
struct ChosenEpsilon {
  double epsilon = 0;  // 0: there is none
  std::string reason;  // why it is this; or why there is none
  // Where there is none: "ORACLE_BREAKS_CONTRACT", or "ORACLE_NO_REACH".
  std::string failure;
};
ChosenEpsilon ChooseEpsilon(const ExaminationReport& report);

// The epsilon that "auto" goes on with after a mesh of epsilon `epsilon` with this report: a
// quarter of the reach that its certificate shows, where the mesh was too coarse for that. Nothing:
// no smaller one would help.
std::optional<ChosenEpsilon> ChooseFinerEpsilon(const Report& report, double epsilon);

// What an oracle, or the check of its answers' shape, says of a batch that was not answered.
struct OracleFault {
  enum class Kind {
    kRaised,       // the oracle failed
    kShape,        // an answer has the wrong shape
    kNotFinite,    // an answer is not finite
    kInexact,      // it computes in less than double precision
    kTouchesZero,  // an equation touches zero without passing through it
    kDerivative,   // derivatives that it was given are not those of its function
  };
  Kind kind = Kind::kRaised;
  std::string what;  // its words
};

// Tests an oracle against its contract, before a mesh depends on it, as a state machine: gives the
// queries of one batch after the other, and takes their answers.
//
//   auto examiner = Examiner::Create(spec, epsilon);
//   while (const auto batch = examiner->NextBatch()) {
//     examiner->Absorb(answers_of(*batch), seconds_that_took);
//   }
//   std::cout << ToText(examiner->report());
//
// Tests finiteness and determinism; whether closest points are closest, on M, and at right angles
// to M; the dimension; tangent bases; sizes; walls; intersections with flats; smoothness; the
// reach, and whether epsilon suits it; the number of components; speed. Reads no clock.
// Deterministic: the specification and the answers determine the queries and all findings, except
// those about speed. No QuerySource: it takes answers that no one has checked, the time that they
// took, and that there are none.
class Examiner {
 public:
  // Of a specification: its dimensions, capabilities, walls, box, seeds and random_seed. It need
  // not be valid: what keeps the examination from asking is a finding. `epsilon`: that a mesh is
  // planned with.
  static std::unique_ptr<Examiner> Create(Specification spec, std::optional<double> epsilon);
  virtual ~Examiner() = default;

  // Returns the next queries, one block, or nullptr once the examination is over: the same batch
  // until Absorb or Fail.
  virtual std::shared_ptr<const QueryBatch> NextBatch() = 0;
  // Takes the answers to the current batch, and how long they took; 0: not measured. Returns
  // kOracleShape, or kFailedPrecondition without a current batch; then nothing has changed. Values
  // are not checked before: what is wrong with them is a finding.
  virtual Status Absorb(const Answers& answers, double seconds) = 0;
  // There will be no answers to the current batch: that is the last finding. No effect once the
  // examination is over.
  virtual void Fail(const OracleFault& fault) = 0;

  // All that was found so far, in the order in which it was found; sorted once it is over.
  virtual const ExaminationReport& report() const = 0;
};

}  // namespace stellate::core
