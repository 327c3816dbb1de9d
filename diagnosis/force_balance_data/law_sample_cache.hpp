// Forces of laws along one set of recordings, kept by place, law and parameters. A search asks for
// the same ones over and over: the shapes that every ranking tries, and laws that a fit holds. What
// is kept has been computed, so results do not depend on it. Safe for several threads.
//
// Memory: at most 128 MB; what comes last stays.
#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <functional>
#include <memory>
#include <mutex>
#include <vector>

namespace graybox {

class LawSampleCache {
 public:
  // Both by their addresses, which must last.
  struct Key {
    const void* place = nullptr;
    const void* law = nullptr;
    std::vector<double> parameters;
    friend bool operator==(const Key&, const Key&) = default;
  };
  using Samples = std::shared_ptr<const Eigen::VectorXd>;

  explicit LawSampleCache(Eigen::Index samples);

  [[nodiscard]] Samples get(Key key, const std::function<Eigen::VectorXd()>& compute);

 private:
  struct Entry {
    Key key;
    Samples samples;
  };
  std::mutex mutex_;
  std::vector<Entry> entries_;  // each key has one place here
};

}  // namespace graybox
