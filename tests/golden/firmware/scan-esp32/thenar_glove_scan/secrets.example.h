/* The Wi-Fi that the board joins. Copy this file to secrets.h in the same folder, and fill it in: thenar neither writes
   nor reads that file. Keep it out of your repository.

   thenar 0.1.0, template sketch/secrets.example.h.j2. */
#ifndef THENAR_SECRETS_H
#define THENAR_SECRETS_H

#define THENAR_WIFI_SSID ""
#define THENAR_WIFI_PASSWORD ""

#endif
