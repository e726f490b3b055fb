#pragma once

#include <memory>
#include <utility>
#include <vector>

#include "core/query_source.h"
#include "core/run/certification.h"
#include "core/run/round_trip.h"
#include "core/run/tangent_finder.h"

namespace stellate::core {

// What the answers to a round trip are for.
enum class Purpose { kSeeds, kFaceSeeds, kWallCheck, kSample, kCandidates, kSpares, kCrowds };

// The one source that a run queries at a time: a round trip, or the certificate.
//
//   current.Ask(engine, candidates, Purpose::kCandidates);
//   // ... drive it as a QuerySource, then:
//   if (current.purpose() == Purpose::kCandidates) Insert(current.trip()->answers());
template <int K>
class CurrentSource final : public QuerySource {
 public:
  CurrentSource(const OracleCapabilities& oracle, TangentFinder finder)
      : oracle_(oracle), finder_(std::move(finder)) {}

  // Goes on with a round trip, in place of what was there. The engine must outlive the trip, and
  // not change before its answers are complete.
  void Ask(const Engine<K>& engine, CandidateSet<K> candidates, Purpose purpose) {
    certification_.reset();
    trip_ = std::make_unique<RoundTrip<K>>(engine, oracle_, finder_, std::move(candidates));
    purpose_ = purpose;
  }
  // Goes on with the certificate. REQUIRES: Close() came before, as its memory may be large.
  void Certify(std::unique_ptr<Certification> certification) {
    certification_ = std::move(certification);
  }
  // Forgets what was there.
  void Close() {
    trip_.reset();
    certification_.reset();
  }

  std::vector<QueryBlock> Questions() override { return source().Questions(); }
  void Absorb(const std::vector<AnswerBlock>& answers) override { source().Absorb(answers); }
  bool asks_for_tangents() const override { return trip_ && trip_->asks_for_tangents(); }

  // One of these is null.
  const RoundTrip<K>* trip() const { return trip_.get(); }
  Certifier* certifier() const { return certification_ ? &certification_->certifier() : nullptr; }
  Purpose purpose() const { return purpose_; }  // of the trip
  TangentFinder& finder() { return finder_; }

 private:
  QuerySource& source() { return trip_ ? static_cast<QuerySource&>(*trip_) : *certifier(); }

  const OracleCapabilities oracle_;
  TangentFinder finder_;
  std::unique_ptr<RoundTrip<K>> trip_;
  std::unique_ptr<Certification> certification_;
  Purpose purpose_ = Purpose::kSeeds;
};

}  // namespace stellate::core
