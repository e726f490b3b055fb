#pragma once

#include <cstdint>
#include <deque>
#include <vector>

#include "core/refinement/engine.h"
#include "core/report.h"

namespace stellate::core {

// Estimates what is left of a run, in queries: those of the vertices still to come, as many for
// each as so far, and those of the certificate.
class ProgressMeter {
 public:
  explicit ProgressMeter(const Specification& spec);

  // Takes known points of M that did not join the sample: the seeds' closest points. The share of
  // them that the growing sample has come near is the share of M that it covers.
  void Know(const AnsweredPoints& seeds, const std::vector<std::uint8_t>& used);

  // Updates the counts, the phase, the fraction and is_foreseeable; rounds and queries are the
  // caller's. is_certifying: every rule holds, and the certificate queries. to_sample: an estimate
  // of the points still to come before there are stars; 0: there are stars.
  template <int K>
  void Measure(const Engine<K>& engine, bool is_certifying, double to_sample, Progress* progress);

 private:
  struct Left {
    double vertices = 0;
    bool is_known = false;
  };
  struct Seen {
    double vertices = 0, broken = 0;
  };

  template <int K>
  void Cover(const Stars<K>& stars);
  template <int K>
  Left LeftToSample(const Engine<K>& engine, double to_sample);
  template <int K>
  Left LeftToRefine(const Engine<K>& engine);
  double QuestionsOfCertificate(const Progress& progress, double to_come) const;

  double epsilon_;
  bool is_thorough_;
  bool has_walls_;
  int k_;
  std::vector<double> open_;     // known points that the sample is not near yet, d each
  std::size_t known_ = 0;        // of them at first
  std::uint32_t looked_at_ = 0;  // vertices
  std::deque<Seen> seen_;        // in recent rounds, while the same rules were tested
  bool judged_all_ = false;
  std::uint64_t before_certificate_ = 0;  // queries
};

}  // namespace stellate::core
