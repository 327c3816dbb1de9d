// The other half; `struct Twice::Inner` and the declaration of Once define nothing twice.
#pragma once

namespace graybox {

class Once;
class Twice {
 public:
  struct Inner;
};
struct Twice::Inner {};
enum class Kind { kTwo };

}  // namespace graybox
