// SPDX-License-Identifier: BSD-3-Clause
//
// Preloaded by soak.py into a viewfixd with AddressSanitizer: each second it writes how many bytes
// are allocated to the file that VIEWFIX_HEAP_BYTES names.
#include <pthread.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <unistd.h>

size_t __sanitizer_get_current_allocated_bytes(void);

static void* Count(void* path) {
  // Signals are for viewfixd's own threads.
  sigset_t all;
  sigfillset(&all);
  pthread_sigmask(SIG_BLOCK, &all, NULL);
  while (1) {
    FILE* file = fopen(path, "w");
    if (file != NULL) {
      fprintf(file, "%zu\n", __sanitizer_get_current_allocated_bytes());
      fclose(file);
    }
    sleep(1);
  }
  return NULL;
}

__attribute__((constructor)) static void Start(void) {
  pthread_t thread;
  char* path = getenv("VIEWFIX_HEAP_BYTES");
  if (path != NULL) pthread_create(&thread, NULL, Count, path);
}
