#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <memory>
#include <vector>

#include "core/batch.h"
#include "core/execution.h"
#include "core/peers.h"
#include "core/report.h"
#include "core/specification.h"

namespace stellate::core {

// The epsilon-refinement of Chapter 5 as a state machine. It never calls an oracle: it gives the
// queries of one round and takes their answers.
//
//   const Expected<std::unique_ptr<Mesher>> made = Mesher::Create(spec);
//   if (!made) return made.error();
//   Mesher& mesher = **made;
//   while (const auto batch = mesher.NextBatch()) {
//     const Expected<MeshDelta> delta = mesher.Absorb(AnswersTo(*batch));
//     if (!delta) mesher.Fail(delta.error());
//   }
//   if (mesher.report().certificate.certified) Use(mesher.Points(), mesher.Simplices());
//
// Deterministic: the specification and the answers determine the mesh bit for bit, for any
// Execution. One thread at a time may use a Mesher, except that any thread may call Interrupt;
// nothing here blocks, logs or reads a clock.
class Mesher {
 public:
  // Returns a mesher before its first round. Errors: those of Validate, of either.
  static Expected<std::unique_ptr<Mesher>> Create(Specification spec, Execution execution = {});
  // One of those of many parts, which make the mesh of one together, bit for bit. Each is given the
  // same answers, asks and says the same, and holds the mesh; they share what there is to compute.
  // `peers` is borrowed. CreatePart and Absorb wait for the other parts: all make the same
  // calls, and none is interrupted while it is in one.
  static Expected<std::unique_ptr<Mesher>> CreatePart(Specification spec, const Peers& peers,
                                                      Execution execution = {});
  virtual ~Mesher() = default;

  // Returns the queries of the next round, or nullptr once the run is over: the same batch until
  // Absorb, Cancel or Fail. It stays as it is for as long as it is held.
  virtual std::shared_ptr<const QueryBatch> NextBatch() = 0;

  // Takes the answers to the current batch and refines. On error (CheckAnswers, idempotence,
  // kFailedPrecondition without a current batch) nothing has changed: the same batch may be
  // answered again, or Fail called.
  virtual Expected<MeshDelta> Absorb(const Answers& answers) = 0;

  // Makes an Absorb under way, and every later one, return soon with kCancelled. The mesh can then
  // only be cancelled. Any thread may call this at any time.
  virtual void Interrupt() = 0;

  // End the run now and keep the mesh as it is: as cancelled, or as failed for this reason, which
  // the report holds. No effect once it is over.
  virtual void Cancel() = 0;
  virtual void Fail(Status reason) = 0;

  virtual const Specification& specification() const = 0;
  virtual const Progress& progress() const = 0;
  virtual const Report& report() const = 0;  // complete once NextBatch returned nullptr

  // The points of the current mesh, d x n, valid until Absorb.
  virtual Eigen::Map<const Eigen::MatrixXd> Points() const = 0;
  // Compute tangent bases, (d k) x n laid out as QueryBlock::bases, and simplices, k+1 ascending
  // vertex ids each, or k of the boundary alone, in the order of their lowest vertex.
  virtual Eigen::MatrixXd Tangents() const = 0;
  virtual std::vector<std::uint32_t> Simplices() const = 0;
  // Compute the labels of these simplices, in their order, as many each as
  // Specification::labels_per_simplex.
  virtual std::vector<std::int8_t> Labels() const = 0;
};

}  // namespace stellate::core
