#pragma once

#include <cstddef>
#include <deque>

namespace stellate::server {

// Estimates how long a worker takes for n queries, seconds = fixed + each * n, and how many queries
// to put into its next chunk.
//
//   Pace pace({0.25, 60});                   // chunks of 0.25 seconds, of a minute at most
//   pace.Answered({1, 0.01, false, false});  // after each chunk
//   n = pace.FullChunk();                    // for the next chunk
//
// The line is fitted to the newest chunks by least squares of relative errors; older chunks weigh
// less. Only the part of the fixed cost that exceeds its uncertainty is used, since scattered times
// look like a fixed cost. Chunks of one size show no fixed cost: the last estimate stays, at first
// 0.
//
// The cost of a query is at most the mean of the largest chunk, however old that is: small chunks,
// whose times scatter with their queries, do not show that a call has a high fixed cost.
//
// A worker begins with one query. A chunk may be eight times the largest chunk so far while that
// took far less than the target, else twice.
class Pace {
 public:
  struct Chunk {
    double queries = 0;
    double seconds = 0;  // since it was sent or, where that is later, since the answer before it
    bool cut = false;    // smaller than FullChunk
    double behind = 0;   // seconds that it waited for that answer: its travel took no time then
  };
  struct Aim {
    double seconds = 0;  // target for a chunk, or four times the fixed cost if that is more
    double limit = 0;    // the most that a chunk may take
  };

  explicit Pace(Aim aim) : aim_(aim) {}
  void MayTake(double seconds) { aim_.limit = seconds; }

  void Answered(const Chunk& chunk);
  // Forgets all measurements, after a chunk that ran out of time.
  void BeginAgain() { *this = Pace(aim_); }

  bool known() const { return !newest_.empty(); }
  bool is_calibrated() const { return newest_.size() > 1; }
  double fixed() const { return fixed_; }
  double each() const { return each_; }
  double Seconds(double queries) const { return fixed_ + each_ * queries; }
  // Whether chunks of more than one size were measured, so that the fixed cost is known.
  bool SizesDiffer() const;
  // An upper estimate for n queries: while all chunks were of one size, all of their time may be
  // fixed.
  double AtMost(double queries) const;
  // The most queries to put into one chunk, 1 or more.
  double FullChunk() const;

 private:
  double Largest() const;
  double Whole() const;
  void Fit();
  double FixedError(double sum_nn, double determinant) const;

  Aim aim_;
  std::deque<Chunk> newest_;               // the newest last
  Chunk largest_;                          // of all, or a later one of half its size or more
  double line_fixed_ = 0, line_each_ = 0;  // of the line
  double fixed_ = 0, each_ = 0;            // the estimate
  double reach_ = 1;                       // the largest chunk that its times allow so far
};

}  // namespace stellate::server
