// Base of what has an identity, a device, a thread or a file: neither copied nor moved.
#pragma once

namespace equipoise {

struct NoCopy {
  NoCopy() = default;
  NoCopy(const NoCopy&) = delete;
  NoCopy& operator=(const NoCopy&) = delete;
};

}  // namespace equipoise
