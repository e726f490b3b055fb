#include "server/oracles/pace.h"

#include <algorithm>
#include <cmath>

namespace stellate::server {
namespace {

constexpr std::size_t kRemembered = 16;  // chunks
constexpr double kDecay = 0.8;           // weight of a chunk, relative to the next one
constexpr double kShortest = 1e-6;       // seconds: clocks measure nothing shorter
// Weight of the last estimate of the fixed cost, relative to all chunks: sizes a tenth apart do not
// suffice to measure it, sizes a factor of two apart do.
constexpr double kPriorWeight = 0.01;
constexpr double kLeastError = 0.03;  // relative, of times: two chunks do not prove a smaller one

constexpr double kFixedShare = 0.25;  // of a chunk's time, at most, where the chunk may be larger
constexpr double kGrowth = 2;         // of chunks, at most
constexpr double kFastGrowth = 8;     // of chunks whose queries take less than this share:
constexpr double kFast = 0.1;
// A chunk cut to less than this part of the largest is no evidence of the pace, unless it took
// kSurprise times its expected time.
constexpr double kSmallCut = 4;
constexpr double kSurprise = 2;
constexpr double kComparable = 2;  // a chunk replaces one at most so many times as large

}  // namespace

bool Pace::SizesDiffer() const {
  return std::any_of(newest_.begin(), newest_.end(), [this](const Chunk& chunk) {
    return chunk.queries != newest_.front().queries;
  });
}

double Pace::AtMost(double queries) const {
  if (!known() || SizesDiffer()) return Seconds(queries);
  return std::max(Seconds(queries), Seconds(newest_.front().queries));
}

double Pace::Largest() const {
  double largest = 0;
  for (const Chunk& chunk : newest_) largest = std::max(largest, chunk.queries);
  return largest;
}

double Pace::Whole() const { return std::max(aim_.seconds, fixed_ / kFixedShare); }

double Pace::FullChunk() const {
  if (!known()) return 1;
  const double allowed = std::max(aim_.limit - fixed_, 0.0) / 2;
  const double seconds = std::min(Whole() - fixed_, allowed);
  double queries = each_ > 0 ? seconds / each_ : reach_;
  // Two sizes show the fixed cost.
  const double twofold = 2 * Largest();
  if (!SizesDiffer() && each_ * twofold < allowed) queries = std::max(queries, twofold);
  return std::clamp(queries, 1.0, reach_);
}

void Pace::Answered(const Chunk& measured) {
  Chunk chunk = measured;
  // A chunk that travelled while another was being answered, or was answered beside it, seems too
  // fast. It took no longer than the time since it was sent.
  const double since_sent = chunk.seconds + chunk.behind;
  if (chunk.behind > 0 && kSurprise * chunk.seconds < Seconds(chunk.queries)) {
    chunk.seconds = std::min(since_sent, Seconds(chunk.queries));
  }
  const bool dearer = measured.seconds * largest_.queries > largest_.seconds * chunk.queries;
  const bool cheaper = since_sent * largest_.queries < largest_.seconds * chunk.queries;
  if ((chunk.behind == 0 || dearer || cheaper) && kComparable * chunk.queries >= largest_.queries) {
    largest_ = measured;
    if (cheaper) largest_.seconds = since_sent;
  }
  const bool is_evidence = !chunk.cut || !SizesDiffer() || kSmallCut * chunk.queries >= Largest() ||
                           chunk.seconds > kSurprise * Seconds(chunk.queries);
  if (!is_evidence) return;
  newest_.push_back(chunk);
  Fit();
  const bool guess = !SizesDiffer();  // all of the time may be the queries'
  const double fixed = guess ? 0 : fixed_;
  const double each = guess ? chunk.seconds / chunk.queries : each_;
  const bool fast = each * chunk.queries < kFast * (Whole() - fixed);
  const double more = (fast ? kFastGrowth : kGrowth) * chunk.queries;
  if (fixed + each * more <= aim_.limit) reach_ = std::max(reach_, more);
}

void Pace::Fit() {
  if (newest_.size() > kRemembered) newest_.pop_front();
  // Errors are relative to the expected time: relative to the measured one, the fastest would win.
  const bool first = newest_.size() == 1;
  double weight = 1, sum = 0, sum_n = 0, sum_nn = 0, sum_t = 0, sum_nt = 0;
  for (auto chunk = newest_.rbegin(); chunk != newest_.rend(); ++chunk, weight *= kDecay) {
    const double n = chunk->queries;
    const double t = std::max(chunk->seconds, kShortest);
    const double expected = first ? t : std::max(Seconds(n), kShortest);
    const double w = weight / (expected * expected);
    sum += w;
    sum_n += w * n;
    sum_nn += w * n * n;
    sum_t += w * t;
    sum_nt += w * n * t;
  }
  const double prior = kPriorWeight * sum;
  const double all = sum + prior;
  const double determinant = all * sum_nn - sum_n * sum_n;
  line_each_ = (all * sum_nt - sum_n * (sum_t + prior * line_fixed_)) / determinant;
  line_fixed_ = (sum_t + prior * line_fixed_ - line_each_ * sum_n) / all;
  if (line_each_ < 0) {  // larger chunks were faster: all of the time is fixed
    line_each_ = 0;
    line_fixed_ = sum_t / sum;
  } else if (line_fixed_ < 0) {
    line_fixed_ = 0;
    line_each_ = sum_nt / sum_nn;
  }
  fixed_ = std::max(line_fixed_ - FixedError(sum_nn, determinant), 0.0);
  each_ = std::max((sum_nt - fixed_ * sum_n) / sum_nn, 0.0);
  // A query costs at most the mean of the largest chunk; the rest of a small chunk's time is
  // scatter.
  const double share = std::max(largest_.seconds, kShortest) / largest_.queries;
  if (each_ <= share) return;
  each_ = share;
  fixed_ = std::max(fixed_, (sum_t - each_ * sum_n) / sum);
}

// The standard error of the line's fixed cost, by how the chunks scatter about it.
double Pace::FixedError(double sum_nn, double determinant) const {
  double errors = kLeastError * kLeastError, count = 0, weight = 1;
  for (auto chunk = newest_.rbegin(); chunk != newest_.rend(); ++chunk, weight *= kDecay) {
    const double expected = std::max(line_fixed_ + line_each_ * chunk->queries, kShortest);
    const double error = chunk->seconds / expected - 1;
    errors += weight * error * error;
    count += weight;
  }
  return std::sqrt(errors / std::max(count - 1, 1.0) * sum_nn / determinant);
}

}  // namespace stellate::server
