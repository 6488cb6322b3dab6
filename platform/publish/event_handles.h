// SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <event2/buffer.h>
#include <event2/event.h>
#include <event2/http.h>
#include <event2/listener.h>

#include <memory>

namespace viewfix {

// libevent's objects, freed at the end of the scope.
struct FreeEvents {
  void operator()(event_base* base) const { event_base_free(base); }
  void operator()(event* one) const { event_free(one); }
  void operator()(evhttp* http) const { evhttp_free(http); }
  void operator()(evbuffer* buffer) const { evbuffer_free(buffer); }
  void operator()(evconnlistener* listener) const { evconnlistener_free(listener); }
};

template <typename T>
using EventHandle = std::unique_ptr<T, FreeEvents>;

}  // namespace viewfix
