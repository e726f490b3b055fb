#pragma once

#include <cstddef>
#include <deque>

namespace stellate::server {

// How long a worker takes for n queries, seconds = fixed + each * n, by the newest of its chunks,
// and how many it should have at once.
//
// The line through its chunks has least squares of relative errors, the older counting less. Of the
// fixed cost that it shows as much is believed as is beyond doubt, for where times scatter a part
// of them looks fixed. Where all chunks are of one size nothing can be seen of it: then it is what
// it was held to be, at first nothing.
//
// A query is held to take no more than its share of the largest chunk, however long ago that was:
// of small ones, whose times scatter by what is asked, no line tells that a call takes long
// whatever it holds.
//
// A worker begins with one query. While the queries take far less than they may, a chunk may be
// eight times the largest before, else twice.
class Pace {
 public:
  struct Chunk {
    double queries = 0;
    double seconds = 0;
    bool cut = false;     // smaller than it might have been
    bool queued = false;  // asked while the worker had another: travelled meanwhile
  };
  struct Aim {
    double seconds = 0;  // that a chunk should take, or four times the fixed cost if that is more
    double limit = 0;    // seconds that it may take
  };

  explicit Pace(Aim aim) : aim_(aim) {}
  void MayTake(double seconds) { aim_.limit = seconds; }

  void Answered(const Chunk& chunk);
  // A chunk took longer than it may, and who knows how long.
  void BeginAgain() { *this = Pace(aim_); }

  bool known() const { return !newest_.empty(); }
  bool settled() const { return newest_.size() > 1; }
  double fixed() const { return fixed_; }
  double each() const { return each_; }
  double Seconds(double queries) const { return fixed_ + each_ * queries; }
  // Chunks of more than one size were seen, so that the fixed cost is more than a guess.
  bool SizesDiffer() const;
  // The longest that n queries may be expected to take: while all chunks were of one size, all of
  // their time may be fixed.
  double AtMost(double queries) const;
  // The most queries that it should have at once, 1 or more.
  double FullChunk() const;

 private:
  double Largest() const;
  double Whole() const;
  void Fit();
  double Doubt(double sum_nn, double determinant) const;

  Aim aim_;
  std::deque<Chunk> newest_;               // the newest last
  Chunk largest_;                          // of all, or a later one of half its size or more
  double line_fixed_ = 0, line_each_ = 0;  // of the line
  double fixed_ = 0, each_ = 0;            // with what is believed of it
  double reach_ = 1;                       // the most that it has shown itself fit for
};

}  // namespace stellate::server
