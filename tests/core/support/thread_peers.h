#pragma once

#include <atomic>
#include <barrier>
#include <cstdint>
#include <functional>
#include <thread>
#include <utility>
#include <vector>

#include "core/peers.h"

namespace stellate::core::testing {

// Parts in threads of one process, which count the bytes that they send to others.
class ThreadPeers {
 public:
  explicit ThreadPeers(int parts) : parts_(parts), barrier_(parts) {
    mail_.resize(static_cast<std::size_t>(parts));
    counts_.resize(static_cast<std::size_t>(parts));
  }

  // Runs work(peers) for each part at the same time.
  void Run(const std::function<void(const Peers&)>& work) {
    std::vector<std::thread> threads;
    for (int part = 0; part < parts_; ++part)
      threads.emplace_back([this, part, &work] { work(Part(this, part)); });
    for (std::thread& thread : threads) thread.join();
  }

  std::uint64_t sent() const { return sent_; }            // bytes
  std::uint64_t exchanges() const { return exchanges_; }  // of all, together

 private:
  class Part final : public Peers {
   public:
    Part(ThreadPeers* all, int part) : all_(all), part_(part) {}
    int part() const override { return part_; }
    int parts() const override { return all_->parts_; }
    std::vector<Bytes> Exchange(std::vector<Bytes> bytes) const override {
      const auto here = static_cast<std::size_t>(part_);
      for (std::size_t part = 0; part < bytes.size(); ++part)
        if (part != here) all_->sent_ += bytes[part].size();
      if (here == 0) ++all_->exchanges_;
      all_->mail_[here] = std::move(bytes);
      all_->barrier_.arrive_and_wait();
      std::vector<Bytes> received;
      for (auto& mail : all_->mail_) received.push_back(std::move(mail[here]));
      all_->barrier_.arrive_and_wait();
      return received;
    }
    Sums Sum(std::uint64_t count) const override {
      all_->counts_[static_cast<std::size_t>(part_)] = count;
      all_->barrier_.arrive_and_wait();
      Sums sums{0, 0};
      for (int part = 0; part < parts(); ++part) {
        if (part == part_) sums.before = sums.all;
        sums.all += all_->counts_[static_cast<std::size_t>(part)];
      }
      all_->barrier_.arrive_and_wait();
      return sums;
    }

   private:
    ThreadPeers* all_;
    int part_;
  };

  const int parts_;
  std::barrier<> barrier_;
  std::vector<std::vector<Peers::Bytes>> mail_;  // by sender, then by who gets it
  std::vector<std::uint64_t> counts_;
  std::atomic<std::uint64_t> sent_ = 0, exchanges_ = 0;
};

}  // namespace stellate::core::testing
